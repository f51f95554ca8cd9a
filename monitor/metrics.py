"""What a run says about one monitored link: was the attack seen, how soon, and were there false alarms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkMetrics:
    """Detection on one directed link.

    Attributes:
        attacked: whether an attack ran on it.
        attack_start_step: first step of the first attack, None without one.
        alarm_step: first step with an alarm at or after the attack's start (any alarm when never attacked).
        attack_start_sec: the same in seconds.
        alarm_sec: the same in seconds.
        detection_delay_sec: alarm_sec - attack_start_sec, None when not attacked or not seen.
        false_alarms: alarm onsets while no attack runs on this link.
        residual_before: largest |r| of any component before the attack, NaN without a sample.
        residual_after: largest |r| of any component from the attack's start on, NaN when never attacked.
        threshold: (p,) the last threshold, NaN when it was never set.
    """

    attacked: bool
    attack_start_step: int | None
    alarm_step: int | None
    attack_start_sec: float | None
    alarm_sec: float | None
    detection_delay_sec: float | None
    false_alarms: int
    residual_before: float
    residual_after: float
    threshold: NDArray[np.float64]


def link_metrics(
    alarm: NDArray[np.bool_],
    residual: NDArray[np.float64],
    attacks: Sequence[tuple[int, int]],
    sampling_period_sec: float,
    *,
    threshold: NDArray[np.float64] | None = None,
    armed: NDArray[np.bool_] | None = None,
) -> LinkMetrics:
    """Measure one link of one run.

    Args:
        alarm: (steps,) the detector's verdict.
        residual: (steps, p), NaN where there is none.
        attacks: intervals [start, stop) in steps during which this link was falsified.
        sampling_period_sec: T_s [s].
        threshold: (steps, p), if it is to be reported.
        armed: (steps,) where residuals count; the settling of the observer is no residual before the attack.
    """
    steps = len(alarm)
    under_attack = np.zeros(steps, dtype=bool)
    for start, stop in attacks:
        under_attack[max(start, 0) : max(stop, 0)] = True
    start_step = min((start for start, stop in attacks if stop > start), default=None)
    onsets = alarm & ~np.concatenate([[False], alarm[:-1]])
    alarms = np.flatnonzero(alarm[start_step or 0 :])
    alarm_step = int(alarms[0]) + (start_step or 0) if len(alarms) else None
    seen = start_step is not None and alarm_step is not None
    start_sec = None if start_step is None else start_step * sampling_period_sec
    alarm_sec = None if alarm_step is None else alarm_step * sampling_period_sec
    counted = np.abs(residual) if armed is None else np.where(armed[:, None], np.abs(residual), np.nan)
    return LinkMetrics(
        attacked=start_step is not None,
        attack_start_step=start_step,
        alarm_step=alarm_step,
        attack_start_sec=start_sec,
        alarm_sec=alarm_sec,
        detection_delay_sec=(alarm_step - start_step) * sampling_period_sec
        if alarm_step is not None and start_step is not None
        else None,
        false_alarms=int(np.count_nonzero(onsets & ~under_attack)),
        residual_before=_peak(counted[:start_step]),
        residual_after=_peak(np.abs(residual[start_step:])) if seen or start_step is not None else float("nan"),
        threshold=np.full(residual.shape[1], np.nan) if threshold is None else np.asarray(threshold[-1]),
    )


def _peak(magnitude: NDArray[np.float64]) -> float:
    """Largest entry that is a number, NaN without one."""
    numbers = magnitude[np.isfinite(magnitude)]
    return float(numbers.max()) if numbers.size else float("nan")
