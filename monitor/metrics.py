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


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkTally:
    """What of one link's metrics is known after some of its steps: a run need not be in memory as a whole.

    Attributes:
        steps: how many there were.
        alarm: the last verdict.
        alarm_step: as in LinkMetrics.
        false_alarms: as in LinkMetrics.
        residual_before: as in LinkMetrics.
        residual_after: as in LinkMetrics.
        threshold: as in LinkMetrics.
    """

    steps: int
    alarm: bool
    alarm_step: int | None
    false_alarms: int
    residual_before: float
    residual_after: float
    threshold: NDArray[np.float64]


def init_tally(outputs: int) -> LinkTally:
    """Tally before the first step.

    Args:
        outputs: p, components of the residual.
    """
    nan = float("nan")
    return LinkTally(
        steps=0,
        alarm=False,
        alarm_step=None,
        false_alarms=0,
        residual_before=nan,
        residual_after=nan,
        threshold=np.full(outputs, nan),
    )


def add_steps(
    tally: LinkTally,
    alarm: NDArray[np.bool_],
    residual: NDArray[np.float64],
    attacks: Sequence[tuple[int, int]],
    *,
    threshold: NDArray[np.float64] | None = None,
    armed: NDArray[np.bool_] | None = None,
) -> LinkTally:
    """Take the next steps of a link; arguments as those of `link_metrics`, attacks in steps of the whole run."""
    steps = len(alarm)
    if not steps:
        return tally
    under_attack = np.zeros(steps, dtype=bool)
    for start, stop in attacks:
        under_attack[max(start - tally.steps, 0) : max(stop - tally.steps, 0)] = True
    onsets = alarm & ~np.concatenate([[tally.alarm], alarm[:-1]])
    start_step = _start_step(attacks)
    attacked_from = steps if start_step is None else min(max(start_step - tally.steps, 0), steps)
    counted_from = 0 if start_step is None else attacked_from
    alarms = np.flatnonzero(alarm[counted_from:])
    alarm_step = tally.alarm_step
    if alarm_step is None and len(alarms):
        alarm_step = tally.steps + counted_from + int(alarms[0])
    magnitude = np.abs(residual)
    counted = magnitude if armed is None else np.where(armed[:, None], magnitude, np.nan)
    return LinkTally(
        steps=tally.steps + steps,
        alarm=bool(alarm[-1]),
        alarm_step=alarm_step,
        false_alarms=tally.false_alarms + int(np.count_nonzero(onsets & ~under_attack)),
        residual_before=float(np.fmax(tally.residual_before, _peak(counted[:attacked_from]))),
        residual_after=float(np.fmax(tally.residual_after, _peak(magnitude[attacked_from:]))),
        threshold=tally.threshold if threshold is None else np.array(threshold[-1]),
    )


def metrics_of(tally: LinkTally, attacks: Sequence[tuple[int, int]], sampling_period_sec: float) -> LinkMetrics:
    """Metrics of the steps that were taken; arguments as those of `link_metrics`."""
    start_step, alarm_step = _start_step(attacks), tally.alarm_step
    start_sec = None if start_step is None else start_step * sampling_period_sec
    alarm_sec = None if alarm_step is None else alarm_step * sampling_period_sec
    delay_sec = None
    if alarm_step is not None and start_step is not None:
        delay_sec = (alarm_step - start_step) * sampling_period_sec
    return LinkMetrics(
        attacked=start_step is not None,
        attack_start_step=start_step,
        alarm_step=alarm_step,
        attack_start_sec=start_sec,
        alarm_sec=alarm_sec,
        detection_delay_sec=delay_sec,
        false_alarms=tally.false_alarms,
        residual_before=tally.residual_before,
        residual_after=tally.residual_after,
        threshold=tally.threshold,
    )


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
    tally = add_steps(init_tally(residual.shape[1]), alarm, residual, attacks, threshold=threshold, armed=armed)
    return metrics_of(tally, attacks, sampling_period_sec)


def _start_step(attacks: Sequence[tuple[int, int]]) -> int | None:
    return min((start for start, stop in attacks if stop > start), default=None)


def _peak(magnitude: NDArray[np.float64]) -> float:
    """Largest entry that is a number, NaN without one."""
    numbers = magnitude[np.isfinite(magnitude)]
    return float(numbers.max()) if numbers.size else float("nan")
