"""The phases that a detector goes through: settling, calibrating, armed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from monitor.detectors.protocol import Phase
from monitor.linear import is_missing

if TYPE_CHECKING:
    from monitor.linear import Component, Count, Flag


class Progress(NamedTuple):
    """How far a detector is.

    Attributes:
        age: samples since the observer (re)started.
        learned: samples that calibration has seen.
    """

    age: Count
    learned: Count


class Stage(NamedTuple):
    """What one sample is for.

    Attributes:
        learning: calibration takes it.
        armed: it is judged.
        phase: the Phase number.
    """

    learning: Flag
    armed: Flag
    phase: Count


@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """SETTLING, CALIBRATING, ARMED; a missing sample (residual NaN) restarts the settling, not the calibration.

    Attributes:
        settle_steps: samples without a verdict after every (re)start.
        calibrate_steps: samples that the detector learns from, once.
    """

    settle_steps: int
    calibrate_steps: int

    def advance(self, progress: Progress, first: Component) -> tuple[Progress, Stage]:
        """Take the first component of a residual: observers spread a NaN to every one."""
        age = restarted(is_missing(first), progress.age)
        settled = age > self.settle_steps
        learning = settled & (progress.learned < self.calibrate_steps)
        armed = settled & (progress.learned >= self.calibrate_steps)
        phase = Phase.SETTLING.value + learning + 2 * armed
        return Progress(age, progress.learned + learning), Stage(learning, armed, phase)


def restarted(missing: Flag, age: Count) -> Count:
    """Samples since the last missing one."""
    if isinstance(missing, bool):
        return 0 if missing else age + 1
    return np.where(missing, 0, age + 1)
