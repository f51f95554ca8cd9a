"""One monitor of many links over many steps: all at once where nothing is missing, step by step elsewhere.

Both ways give the same bits. At once costs a tenth: numpy's time goes into calls, not into numbers.
"""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from bags.watch.stacked_observer import StackedObserver
from monitor.detectors import BlockDetector, Detector, Verdict
from monitor.linear import anywhere, is_missing
from monitor.link_monitor import LinkMonitor, MonitorState

Conclusions: TypeAlias = tuple[NDArray[np.uint8], NDArray[np.bool_], tuple[NDArray[np.float64], ...]]
"""Phase and alarm (steps, links); estimate (steps, n, links), residual and threshold (steps, p, links)."""

_WORTH = 16  # steps: fewer are not quicker at once


def run_monitor(
    monitor: LinkMonitor,
    state: MonitorState,
    samples: tuple[NDArray[np.float64], NDArray[np.float64]],
    delivered: NDArray[np.bool_],
    states: int,
) -> tuple[MonitorState, Conclusions]:
    """Take the samples of consecutive steps.

    Args:
        monitor: Stepped with arrays over links.
        state: Its state.
        samples: Known inputs u, shape (steps, m, links), and outputs y, shape (steps, p, links).
        delivered: Shape (steps, links).
        states: n, components of an estimate.
    """
    u, y = samples
    steps, width, links = y.shape
    phase, alarm = np.empty((steps, links), dtype=np.uint8), np.empty((steps, links), dtype=np.bool_)
    numbers = tuple(np.full((steps, size, links), np.nan) for size in (states, width, width))
    gaps = np.flatnonzero(~(delivered & np.isfinite(y).all(axis=1) & np.isfinite(u).all(axis=1)).all(axis=1))
    whole = isinstance(monitor.observer, StackedObserver) and not monitor.blind
    driven = np.concatenate([u, y], axis=1) if u.shape[1] else y
    k = 0
    while k < steps:
        state, output = monitor.step(state, y[k], delivered[k], u[k])
        phase[k], alarm[k] = output.phase, output.alarm
        for target, vector in zip(numbers, (output.estimate, output.residual, output.threshold), strict=True):
            for row, component in enumerate(vector[: target.shape[1]]):
                target[k, row] = component
        k += 1
        following = int(np.searchsorted(gaps, k))
        end = int(gaps[following]) if following < len(gaps) else steps
        if whole and end - k >= _WORTH:
            found = _at_once(monitor, state, driven[k:end])
            if found is not None:
                state, estimate, residual, verdict = found
                phase[k:end], alarm[k:end] = verdict.phase, verdict.alarm
                numbers[0][k:end, : estimate.shape[1]] = estimate
                numbers[1][k:end], numbers[2][k:end] = residual, verdict.threshold
                k = end
    return state, (phase, alarm, numbers)


def _at_once(
    monitor: LinkMonitor, state: MonitorState, driven: NDArray[np.float64]
) -> tuple[MonitorState, NDArray[np.float64], NDArray[np.float64], Verdict] | None:
    """State, estimates, residuals and verdicts of samples that are all there; None where an observer has to restart."""
    observer = monitor.observer
    assert isinstance(observer, StackedObserver)  # noqa: S101 - the caller has seen to it
    if driven.shape[1] != observer.inputs + observer.outputs or (
        len(state.observer) and anywhere(is_missing(state.observer[0]))
    ):
        return None
    following, estimate = observer.run(state.observer, driven)
    residual = np.asarray(estimate.residual)
    if not (np.isfinite(following).all() and np.isfinite(residual).all()):
        return None
    learned, verdict = judge(monitor.detector, state.detector, residual)
    return MonitorState(following, learned, state.judging), np.asarray(estimate.estimate), residual, verdict


def judge(detector: Detector[Any], state: Any, residual: NDArray[np.float64]) -> tuple[Any, Verdict]:  # noqa: ANN401 - as the detector's
    """Verdicts on residuals (steps, p, links), of which some may be missing; the bits of `Detector.step`."""
    if isinstance(detector, BlockDetector) and np.isfinite(residual).all():
        return detector.block(state, residual)
    steps, width, links = residual.shape
    phase, alarm = np.empty((steps, links), dtype=np.int64), np.empty((steps, links), dtype=np.bool_)
    threshold = np.empty((steps, width, links))
    for k in range(steps):
        state, verdict = detector.step(state, residual[k])
        phase[k], alarm[k] = verdict.phase, verdict.alarm
        for row, component in enumerate(verdict.threshold):
            threshold[k, row] = component
    return state, Verdict(phase, threshold, alarm)
