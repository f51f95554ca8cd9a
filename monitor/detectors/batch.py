"""Whole recordings of residuals through a detector."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from monitor.batch import table
from monitor.detectors.protocol import BlockDetector

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from monitor.detectors.protocol import Detector

__all__ = ["Alarms", "run_detector"]


class Alarms(NamedTuple):
    """What a detector concluded over a whole recording.

    Attributes:
        alarm: shape (T,).
        threshold: shape (T, p), units of the residual; NaN before it is set.
    """

    alarm: NDArray[np.bool_]
    threshold: NDArray[np.float64]


def run_detector(detector: Detector[Any], residual: ArrayLike) -> Alarms:
    """Step a detector over residuals; what judges many at once does, with the same bits.

    Args:
        detector: any detector; noise_bound needs the observer: `matched(detector, observer)`.
        residual: shape (T, p); a row of NaN is a sample that never came.

    Raises:
        HistoryError: the residuals are no table of numbers.
    """
    rows = table("residual", residual, call="run_detector(detector, residual)")
    alarm, threshold = np.zeros(len(rows), dtype=np.bool_), np.full(rows.shape, np.nan)
    state = detector.init(rows.shape[1])
    if isinstance(detector, BlockDetector) and len(rows) and np.isfinite(rows).all():
        _, verdicts = detector.block(state, rows[:, :, None])
        alarm[:] = np.asarray(verdicts.alarm)[:, 0]
        threshold[:] = np.asarray(verdicts.threshold)[:, :, 0]
        return Alarms(alarm, threshold)
    for step, row in enumerate(rows.tolist()):
        state, verdict = detector.step(state, row)
        alarm[step], threshold[step] = verdict.alarm, verdict.threshold
    return Alarms(alarm, threshold)
