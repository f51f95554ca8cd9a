"""Values at given times as a function of the step: held or interpolated, once or again and again."""

from enum import StrEnum
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from dgu_sim.linear import FloatArray
from dgu_sim.model import Frozen, Number, finding

__all__ = ["Interpolation", "Table"]

_ROUNDING = 1e-6  # of a sample: what decimal fractions of a second are off by


class Interpolation(StrEnum):
    """What stands between two rows."""

    HOLD = "hold"
    LINEAR = "linear"


class Table(Frozen):
    """Rows at times; before the first row its values hold, after the last one the last row's, unless it repeats.

    A table that repeats begins again when its last row has held as long as the one before it.
    """

    time_sec: tuple[Number, ...] = Field(min_length=1, description="Times of the rows [s], increasing.")
    from_sec: Number = Field(default=0.0, description="Time of the table with which it begins [s].")
    interpolation: Interpolation = Field(
        default=Interpolation.HOLD, description="`hold`: a row's value stays until the next; `linear`: straight lines."
    )
    repeat: bool = Field(default=False, description="Whether it begins again after the last row.")

    @model_validator(mode="after")
    def _increasing(self) -> Self:
        for row in range(1, len(self.time_sec)):
            if not self.time_sec[row] > self.time_sec[row - 1]:
                expected = f"expected a time after {self.time_sec[row - 1]:g}"
                raise finding(("time_sec", row), self.time_sec[row], expected)
        if self.repeat and len(self.time_sec) == 1:
            raise finding(("repeat",), self.repeat, "expected false: one row is the same for ever")
        return self

    def check_rows(self, name: str, count: int) -> None:
        """Raise the validation error of a column that has not as many values as there are times."""
        if count != len(self.time_sec):
            raise finding((name,), f"{count} values", f"expected {len(self.time_sec)}, as many as time_sec")

    def rows(self, steps: NDArray[np.int64], sampling_period_sec: float) -> tuple[NDArray[np.int64], FloatArray]:
        """Return the row that counts at each step, and the share of the way to the next one (0: held)."""
        times, rounding = self._times, _ROUNDING * sampling_period_sec
        t = steps * sampling_period_sec + (self.from_sec - self.time_sec[0])
        if self.repeat:
            period = float(2.0 * times[-1] - times[-2])
            t = t - np.floor((t + rounding) / period) * period
        else:
            period = np.inf
        row = np.maximum(np.searchsorted(times, t + rounding, side="right") - 1, 0)
        if self.interpolation is Interpolation.HOLD:
            return row, np.zeros(len(steps))
        following = np.append(times[1:], period)[row]
        return row, np.clip((t - times[row]) / (following - times[row]), 0.0, 1.0)

    def values(self, column: FloatArray, steps: NDArray[np.int64], sampling_period_sec: float) -> FloatArray:
        """Return a column at each step, shape (steps,)."""
        row, share = self.rows(steps, sampling_period_sec)
        here, there = column[row], column[(row + 1) % len(column)]
        found: FloatArray = here + share * (there - here)
        return found

    @cached_property
    def _times(self) -> FloatArray:
        return np.array(self.time_sec) - self.time_sec[0]
