"""Residuals and detectors for the tests of false-alarm promises."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from monitor.observers import design

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from monitor.detectors import Detector
    from monitor.history import History
    from monitor.observers import LinearObserver, Observer

HALF_WIDTHS = np.array([0.01, 0.02, 0.003])  # noise on V [V], I_t [A], v [V s]


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """Verdicts over time: phase and alarm (steps, runs), threshold (steps, p, runs)."""

    phase: NDArray[np.int64]
    alarm: NDArray[np.bool_]
    threshold: NDArray[np.float64]


@pytest.fixture(name="judge", scope="session")
def _judge() -> Callable[[Detector[Any], NDArray[np.float64]], Judged]:
    """Step a detector through residuals of shape (steps, p, runs)."""

    def run(detector: Detector[Any], residuals: NDArray[np.float64]) -> Judged:
        state = detector.init(residuals.shape[1])
        shape = (len(residuals), residuals.shape[2])
        phase, alarm = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.bool_)
        threshold = np.zeros(residuals.shape)
        for k, residual in enumerate(residuals):
            state, verdict = detector.step(state, residual)
            phase[k], alarm[k] = verdict.phase, verdict.alarm
            for component, limit in enumerate(verdict.threshold):
                threshold[k, component] = limit
        return Judged(phase=phase, alarm=alarm, threshold=threshold)

    return run


@pytest.fixture(name="uio")
def _uio(dgu_history: Callable[..., History]) -> LinearObserver:
    """T's UIO of DGU 1, from exact data."""
    observer = design("full_order", dgu_history(), {}).observer
    assert observer is not None
    return observer  # type: ignore[return-value]  # full order is always linear


@pytest.fixture(name="filtered", scope="session")
def _filtered() -> Callable[[Observer, NDArray[np.float64]], NDArray[np.float64]]:
    """Residual of an observer whose received output is noise alone, (steps, p, runs): it decouples all the rest."""

    def run(observer: Observer, noise: NDArray[np.float64]) -> NDArray[np.float64]:
        state = observer.init((), noise[0])
        residuals = np.empty(noise.shape)
        for k, y in enumerate(noise):
            state, estimate = observer.step(state, (), y)
            residuals[k] = estimate.residual
        return residuals

    return run
