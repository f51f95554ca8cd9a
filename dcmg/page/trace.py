"""Numbers over time in bounded memory, and their smallest and largest values for as many columns as a plot has."""

from collections.abc import Sequence
from typing import IO

import numpy as np
from numpy.typing import NDArray

from dgu_sim.linear import FloatArray


class Trace:
    """The last steps of some channels; older ones make room for new ones.

    Args:
        channels: Number of channels.
        capacity: Steps that are kept.
        file: Where they stand, None: in memory, taken at once, so that it does not grow later.
    """

    def __init__(self, channels: int, capacity: int, file: IO[bytes] | None = None) -> None:
        """Start empty."""
        shape = (channels, max(capacity, 1))
        self._values = np.full(shape, np.nan) if file is None else np.asarray(np.memmap(file, np.float64, shape=shape))
        self.end = 0

    @property
    def start(self) -> int:
        """The oldest step that is kept."""
        return max(0, self.end - int(self._values.shape[1]))

    def add(self, rows: FloatArray) -> None:
        """Append steps, shape (steps, channels)."""
        capacity = self._values.shape[1]
        kept = rows[-capacity:]
        places = np.arange(self.end + len(rows) - len(kept), self.end + len(rows)) % capacity
        self._values[:, places] = kept.T
        self.end += len(rows)

    def at(self, step: int) -> FloatArray:
        """All channels at a step, NaN where it is not kept."""
        if not self.start <= step < self.end:
            return np.full(len(self._values), np.nan)
        row: FloatArray = self._values[:, step % self._values.shape[1]]
        return row

    def span(self, channels: NDArray[np.intp] | Sequence[int], first: int, last: int) -> FloatArray:
        """Steps [first, last) of some channels, shape (channels, steps), NaN where one is not kept."""
        steps = np.arange(first, last)
        found: FloatArray = self._values[np.asarray(channels, dtype=np.intp)[:, None], steps % self._values.shape[1]]
        found[:, (steps < self.start) | (steps >= self.end)] = np.nan
        return found


def extremes(values: FloatArray, size: int) -> tuple[FloatArray, FloatArray]:
    """Smallest and largest value of every `size` steps of (channels, steps); NaN only where there is no number."""
    bins = values.reshape(len(values), -1, size)
    return np.fmin.reduce(bins, axis=-1), np.fmax.reduce(bins, axis=-1)
