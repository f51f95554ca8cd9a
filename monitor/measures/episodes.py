"""One attack on one link: was it seen while it ran, and when."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monitor.measures.intervals import clopper_pearson

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from monitor.measures.intervals import Measured


@dataclass(frozen=True, slots=True, kw_only=True)
class Episode:
    """An attack interval and its detection.

    Attributes:
        start_step: first falsified sample.
        stop_step: first clean sample behind it.
        alarm_step: first sample with an alarm from start to stop (plus the monitor's lag), None when there is none.
        start_sec: the same in seconds.
        duration_sec: length [s].
        delay_sec: time to detection [s], None when missed.
    """

    start_step: int
    stop_step: int
    alarm_step: int | None
    start_sec: float
    duration_sec: float
    delay_sec: float | None

    @property
    def detected(self) -> bool:
        """Whether it was seen while it ran."""
        return self.alarm_step is not None


def detect(alarm: NDArray[np.bool_], attack: tuple[int, int], sampling_period_sec: float, *, lag: int = 0) -> Episode:
    """Look for the alarm that one attack raises.

    Args:
        alarm: (steps,).
        attack: steps [start, stop).
        sampling_period_sec: T_s [s].
        lag: steps by which the monitor tells late, by design.
    """
    start, stop = attack
    steps = np.flatnonzero(alarm[start : stop + lag])
    alarm_step = start + int(steps[0]) if len(steps) else None
    return Episode(
        start_step=start,
        stop_step=stop,
        alarm_step=alarm_step,
        start_sec=start * sampling_period_sec,
        duration_sec=(stop - start) * sampling_period_sec,
        delay_sec=None if alarm_step is None else (alarm_step - start) * sampling_period_sec,
    )


def missed_rate(episodes: Iterable[Episode], level: float = 0.95) -> Measured:
    """Share of the attacks that nobody saw while they ran."""
    missed = [not one.detected for one in episodes]
    return clopper_pearson(sum(missed), len(missed), level)
