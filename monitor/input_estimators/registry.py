"""The methods by name."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from monitor.errors import HistoryError, MonitorError
from monitor.history import sent_outputs
from monitor.input_estimators import delayed, one_step, uie
from monitor.input_estimators.protocol import EstimatorDesign
from monitor.input_reconstruction import CLOSED_LOOP, OPEN_LOOP

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from monitor.history import History

KINDS: dict[str, Callable[[History, Mapping[str, object]], EstimatorDesign]] = {
    one_step.KIND: one_step.design,
    "delayed": delayed.design,
    OPEN_LOOP: uie.design_open_loop,
    CLOSED_LOOP: uie.design_closed_loop,
}


def design(kind: str, history: History, options: Mapping[str, object]) -> EstimatorDesign:
    """Design an estimator of this kind from a history with the applied inputs `d`; a refusal is a value.

    A method raises HistoryError when the history does not allow an estimator: that becomes the refusal.

    Raises:
        MonitorError: unknown kind or option.
    """
    if kind not in KINDS:
        raise MonitorError(f"input estimator kind is {kind!r}, expected one of {', '.join(sorted(KINDS))}")
    if not history.experiments[0].d.shape[1]:
        return _refused(kind, "the history does not say which inputs were applied (d): record them")
    try:
        sent, channels = sent_outputs(history)
        return replace(KINDS[kind](sent, options), channels=channels)
    except HistoryError as error:
        return _refused(kind, str(error))


def _refused(kind: str, reason: str) -> EstimatorDesign:
    return EstimatorDesign(kind=kind, estimator=None, verdict=f"refused: {reason}")
