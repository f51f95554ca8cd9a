"""Sums and extremes over stretches of a run that arrives in windows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


def fold(target: NDArray[np.float64], values: NDArray[np.float64], first_step: int, length: int, how: np.ufunc) -> None:
    """Fold consecutive steps into the stretches that they belong to.

    Args:
        target: Shape (stretches, ...); holds what earlier windows gave.
        values: Shape (steps, ...).
        first_step: Step of the first row of `values`.
        length: Steps of a stretch.
        how: np.add, np.fmin or np.fmax.
    """
    if not len(values):
        return
    stretches = np.arange(first_step, first_step + len(values)) // length
    starts = np.flatnonzero(np.diff(stretches, prepend=-1))
    into = stretches[starts]
    target[into] = how(target[into], how.reduceat(values, starts, axis=0))


def stretches_of(steps: int, length: int) -> int:
    """How many stretches a run has."""
    return -(-steps // length)


@dataclass(frozen=True, slots=True, kw_only=True)
class Envelope:
    """Smallest and largest value of some curves in each stretch: thinned so that no spike is lost.

    Attributes:
        first_step: Step at which the first stretch begins; what comes before it, or behind the last, is left out.
        length: Steps of a stretch.
        low: Shape (stretches, ...).
        high: Shape (stretches, ...).
    """

    first_step: int = 0
    length: int
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    @classmethod
    def empty(cls, steps: int, length: int, *shape: int, first_step: int = 0) -> "Envelope":
        """Before the first window."""
        low = np.full((stretches_of(steps, length), *shape), np.nan)
        return cls(first_step=first_step, length=length, low=low, high=low.copy())

    def add(self, values: NDArray[np.float64], first_step: int) -> None:
        """Take the steps of a window, as far as they lie within."""
        start = first_step - self.first_step
        end = len(self.low) * self.length - start
        mine = values[max(-start, 0) : max(end, 0)]
        fold(self.low, mine, max(start, 0), self.length, np.fmin)
        fold(self.high, mine, max(start, 0), self.length, np.fmax)

    def starts(self, period_sec: float) -> NDArray[np.float64]:
        """First instant of each stretch [s]."""
        return (self.first_step + np.arange(len(self.low), dtype=np.float64) * self.length) * period_sec

    def times(self, period_sec: float) -> NDArray[np.float64]:
        """Instants of the points of `line` [s]."""
        starts = self.starts(period_sec)
        if self.length == 1:
            return starts
        return np.asarray(np.column_stack([starts, starts + 0.5 * self.length * period_sec]).ravel())

    def line(self, *place: int) -> NDArray[np.float64]:
        """One curve: its values, or low and high of each stretch in turn."""
        low, high = (np.moveaxis(one, 0, -1)[place] for one in (self.low, self.high))
        return low if self.length == 1 else np.asarray(np.column_stack([low, high]).ravel())
