"""Measured arrays as histories, observers and detectors from them, and both run over arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dcmg.suggest import did_you_mean
from monitor import detectors, observers
from monitor.batch import Estimates, table
from monitor.detectors.batch import Alarms
from monitor.detectors.batch import run_detector as _run_detector
from monitor.errors import HistoryError, MonitorError
from monitor.history import Experiment, History

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from monitor.detectors.protocol import Detector
    from monitor.observer import Design, RecordedObserver

_CALL = "dcmg.design(u=u, y=y, x=x, sampling_period_sec=0.01)"


def history(
    *,
    y: ArrayLike,
    sampling_period_sec: float,
    x: ArrayLike | None = None,
    u: ArrayLike | None = None,
    d: ArrayLike | None = None,
) -> History:
    """Make a history of one experiment on a plant, from which observers are designed.

    Lists, tuples, pandas and xarray objects do as well as numpy arrays; of one signal, shape (T,) is (T, 1).

    Args:
        y: outputs as they will arrive at the monitor, shape (T, p); a column of NaN is one that is never sent.
        sampling_period_sec: T_s [s].
        x: states, shape (T, n); None: the outputs are the states.
        u: inputs that are known online, shape (T, m); None: there are none.
        d: inputs of the experiment that are unknown online, shape (T, m_d), for input reconstruction only.

    Raises:
        HistoryError: the arrays do not fit together, or one holds no numbers.
    """
    outputs = table("y", y, call=_CALL)
    return History(
        (
            Experiment(
                u=table("u", u, samples=len(outputs), call=_CALL),
                y=outputs,
                x=outputs if x is None else table("x", x, call=_CALL),
                d=table("d", d, samples=len(outputs), call=_CALL),
            ),
        ),
        _period(sampling_period_sec),
    )


def design(
    history: History | None = None,
    *,
    kind: str = "full_order",
    y: ArrayLike | None = None,
    x: ArrayLike | None = None,
    u: ArrayLike | None = None,
    d: ArrayLike | None = None,
    sampling_period_sec: float | None = None,
    **options: object,
) -> Design:
    """Design an observer from recorded data alone (Turan & Ferrari-Trecate 2021, and what followed it).

    Args:
        history: a recorded history; None: made from the arrays, as `dcmg.history` does.
        kind: full_order, reduced_order, delayed, op_uie or cl_uie; docs/observers.md says which when.
        y: outputs, shape (T, p).
        x: states, shape (T, n); None: the outputs are the states.
        u: known inputs, shape (T, m); None: there are none.
        d: inputs unknown online, shape (T, m_d).
        sampling_period_sec: T_s [s].
        options: of this kind, as in `unknown_inputs=2` or `noise_std=1e-3`; docs/observers.md lists them.

    Returns:
        The design. It may be a refusal: `accepted` is False, `observer` None, and `verdict` says why in one line.

    Raises:
        HistoryError: the arrays do not fit together.
        MonitorError: unknown kind or option.
    """
    if kind not in observers.KINDS:
        raise MonitorError(f"kind={kind!r}: {did_you_mean(kind, observers.KINDS)}")
    if history is None:
        if y is None or sampling_period_sec is None:
            raise HistoryError(f"y or sampling_period_sec is missing, expected {_CALL}")
        history = _history(y=y, x=x, u=u, d=d, sampling_period_sec=sampling_period_sec)
    return observers.design(kind, history, options)


def detector(kind: str = "fixed", *, sampling_period_sec: float, **options: object) -> Detector[Any]:
    """Build a detector: what turns residuals into alarms.

    Args:
        kind: fixed, calibrated, noise_bound, chi_squared, cusum, n_of_m (docs/detectors.md says which when), or of a
            plug-in.
        sampling_period_sec: T_s [s].
        options: of this kind, as in `margin=3`; docs/detectors.md lists them.

    Raises:
        MonitorError: unknown kind or option.
    """
    if kind not in detectors.KINDS:
        raise MonitorError(f"kind={kind!r}: {did_you_mean(kind, detectors.KINDS)}")
    return detectors.build(kind, options, _period(sampling_period_sec))


def run_observer(
    observer: RecordedObserver, y: ArrayLike, u: ArrayLike | None = None, x0: ArrayLike | None = None
) -> Estimates:
    """Step an observer over a recording: the numbers that it gives online, bit for bit.

    Args:
        observer: `design.observer`.
        y: received outputs, shape (T, p).
        u: known inputs, shape (T, m); None: there are none.
        x0: first estimate, shape (n,), units of x; None: what the observer itself starts with.

    Raises:
        HistoryError: the arrays do not have the columns that the observer was designed for, or x0 not n numbers.
    """
    return observer.run(u, y, x0)


def run_detector(detector: Detector[Any], residual: ArrayLike) -> Alarms:
    """Step a detector over residuals.

    Args:
        detector: from `dcmg.detector`; noise_bound needs the observer: `dcmg.matched(detector, observer)`.
        residual: shape (T, p); a row of NaN is a sample that never came.

    Raises:
        HistoryError: the residuals are no table of numbers.
    """
    return _run_detector(detector, residual)


_history = history  # `design` has an argument of that name


def _period(sampling_period_sec: object) -> float:
    if isinstance(sampling_period_sec, bool) or not isinstance(sampling_period_sec, (int, float, np.number)):
        raise HistoryError(f"sampling_period_sec is {sampling_period_sec!r}, expected a number of seconds, like 0.01")
    return float(sampling_period_sec)
