"""The methods by name."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from monitor.backstop import guarded
from monitor.carrying import RUNNING, parsed, running_document, running_observer
from monitor.errors import HistoryError
from monitor.history import sent_outputs
from monitor.input_estimators.linear_estimator import LinearInputEstimator
from monitor.input_estimators.protocol import EstimatorDesign
from monitor.options import check_kind

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from monitor.history import History


# What needs scipy is imported when it is asked for: most runs design without.
def _one_step(history: History, options: Mapping[str, object]) -> EstimatorDesign:
    from monitor.input_estimators import one_step  # noqa: PLC0415 - heavy

    return one_step.design(history, options)


def _delayed(history: History, options: Mapping[str, object]) -> EstimatorDesign:
    from monitor.input_estimators import delayed  # noqa: PLC0415 - heavy

    return delayed.design(history, options)


def _open_loop(history: History, options: Mapping[str, object]) -> EstimatorDesign:
    from monitor.input_estimators.uie import design_open_loop  # noqa: PLC0415 - heavy

    return design_open_loop(history, options)


def _closed_loop(history: History, options: Mapping[str, object]) -> EstimatorDesign:
    from monitor.input_estimators.uie import design_closed_loop  # noqa: PLC0415 - heavy

    return design_closed_loop(history, options)


KINDS: dict[str, Callable[[History, Mapping[str, object]], EstimatorDesign]] = {
    "one_step": _one_step,
    "delayed": _delayed,
    "op_uie": _open_loop,
    "cl_uie": _closed_loop,
}


def design(kind: str, history: History, options: Mapping[str, object]) -> EstimatorDesign:
    """Design an estimator of this kind from a history with the applied inputs `d`; a refusal is a value.

    A method raises HistoryError when the history does not allow an estimator: that becomes the refusal.

    Raises:
        MonitorError: unknown kind or option.
    """
    check_kind("input estimator", kind, KINDS)
    if not history.experiments[0].d.shape[1]:
        return _refused(kind, "the history does not say which inputs were applied (d): record them")
    try:
        sent, channels = sent_outputs(history)
        made = guarded(lambda: KINDS[kind](sent, options), lambda reason: _refused(kind, reason))
    except HistoryError as error:
        return _refused(kind, str(error))
    numbers: Mapping[str, object] = made.numbers
    if isinstance(made.estimator, LinearInputEstimator):
        running = running_document(made.estimator.realisation)
        numbers = {**numbers, "channels": channels, "late": made.estimator.lag, RUNNING: running}
    return replace(made, channels=channels, numbers=numbers)


def carried(kind: str, document: str) -> EstimatorDesign | None:
    """Take a design from its document; None where that does not hold everything.

    Args:
        kind: name of the design method.
        document: what `EstimatorDesign.document` was.
    """
    found = parsed(document)
    verdict = str(found.get("verdict", ""))
    numbers = {name: value for name, value in found.items() if name not in {"kind", "accepted", "verdict"}}
    if not found.get("accepted"):
        return EstimatorDesign(kind=kind, estimator=None, verdict=verdict, numbers=numbers) if found else None
    running, channels, late = (found.get(name) for name in (RUNNING, "channels", "late"))
    realisation = running_observer(running) if isinstance(running, dict) else None
    if realisation is None or not isinstance(channels, list) or not isinstance(late, int):
        return None
    estimator = LinearInputEstimator(realisation=realisation, lag=late)
    return EstimatorDesign(kind=kind, estimator=estimator, verdict=verdict, channels=tuple(channels), numbers=numbers)


def _refused(kind: str, reason: str) -> EstimatorDesign:
    return EstimatorDesign(kind=kind, estimator=None, verdict=f"refused: {reason}")
