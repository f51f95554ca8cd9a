"""Alarms without an attack, and attacked samples with one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monitor.measures.edges import onsets
from monitor.measures.intervals import Measured, block_bootstrap, block_sums, clopper_pearson, mean_time_between

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmRates:
    """Alarms of one link, or of several together, by samples and by onsets.

    Attributes:
        quiet_samples: armed samples far from any attack: what false alarms are counted in.
        false_alarm_samples: of these the ones with an alarm.
        false_alarms: alarms that began in them.
        attacked_samples: samples under attack, armed or not.
        seen_samples: of these the ones with an alarm.
        false_alarm_rate: per sample.
        mean_time_between_sec: of false alarms, for one link [s].
        seen_rate: share of the attacked samples with an alarm.
    """

    quiet_samples: int
    false_alarm_samples: int
    false_alarms: int
    attacked_samples: int
    seen_samples: int
    false_alarm_rate: Measured
    mean_time_between_sec: Measured
    seen_rate: Measured


def under_attack(steps: int, attacks: Sequence[tuple[int, int]]) -> NDArray[np.bool_]:
    """(steps,) True in the intervals [start, stop)."""
    found = np.zeros(steps, dtype=np.bool_)
    for start, stop in attacks:
        found[max(start, 0) : max(stop, 0)] = True
    return found


def quiet_steps(
    armed: NDArray[np.bool_], attacks: Sequence[tuple[int, int]], aftermath_steps: int
) -> NDArray[np.bool_]:
    """(steps,) True where an alarm is false: armed, not attacked, and not just after an attack.

    An attack's end is a jump that a residual rightly shows: it is held neither for nor against a monitor.

    Args:
        armed: (steps,) whether the monitor judges.
        attacks: intervals [start, stop) on this link.
        aftermath_steps: steps behind each attack that do not count.
    """
    widened = [(start, stop + aftermath_steps) for start, stop in attacks]
    return armed & ~under_attack(len(armed), widened)


def alarm_rates(
    alarm: NDArray[np.bool_],
    quiet: NDArray[np.bool_],
    attacked: NDArray[np.bool_],
    sampling_period_sec: float,
    *,
    block_steps: int,
    seed: int,
    level: float = 0.95,
) -> AlarmRates:
    """Rates over (steps, links); intervals by blocks of time, because alarms of neighbouring samples belong together.

    Args:
        alarm: (steps, links).
        quiet: (steps, links) where an alarm is false.
        attacked: (steps, links) where an alarm is right.
        sampling_period_sec: T_s [s].
        block_steps: length of a block.
        seed: of the bootstrap.
        level: confidence.
    """
    false, began, seen = alarm & quiet, onsets(alarm) & quiet, alarm & attacked
    counts = [int(np.count_nonzero(one)) for one in (quiet, false, began, attacked, seen)]
    quiet_count, false_count, onset_count, attacked_count, seen_count = counts
    return AlarmRates(
        quiet_samples=quiet_count,
        false_alarm_samples=false_count,
        false_alarms=onset_count,
        attacked_samples=attacked_count,
        seen_samples=seen_count,
        false_alarm_rate=_rate(false, quiet, block_steps, seed, level),
        mean_time_between_sec=mean_time_between(onset_count, quiet_count * sampling_period_sec, level),
        seen_rate=_rate(seen, attacked, block_steps, seed, level),
    )


def _rate(hits: NDArray[np.bool_], among: NDArray[np.bool_], block_steps: int, seed: int, level: float) -> Measured:
    """Bootstrap where there is something to draw; all or nothing has no spread, so its limit is the binomial one."""
    successes, trials = int(np.count_nonzero(hits)), int(np.count_nonzero(among))
    if successes in {0, trials}:
        return clopper_pearson(successes, trials, level)
    above = block_sums(hits.sum(axis=1), block_steps)
    below = block_sums(among.sum(axis=1), block_steps)
    return block_bootstrap(above, below, seed=seed, level=level)
