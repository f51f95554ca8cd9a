"""Exogenous random numbers as pure functions of (seed, stream, DGU, index)."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from dgu_sim.linear import FloatArray

__all__ = ["BLOCK", "RandomSource", "Stream", "first_step"]

BLOCK = 256
"""Numbers are drawn in blocks of this many: every shape of a run draws whole blocks, so it draws the same ones."""


class Stream(IntEnum):
    """Independent random streams of one DGU."""

    NOISE = 1
    INITIAL = 2
    HISTORY = 3
    HISTORY_NOISE = 4
    POISON = 5
    GRID = 6
    """What differs from DGU to DGU of a generated grid, drawn with the grid's own seed."""
    ATTACK = 1_000_000
    """The n-th attack of a run draws from stream ATTACK + n; a link's place among its links stands for the DGU."""
    LOAD = 1000
    """The n-th load of a DGU draws from stream LOAD + n."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomSource:
    """Random access to one stream of one DGU.

    Block b comes from Generator(Philox(SeedSequence((seed, stream, dgu, b)))).
    """

    seed: int
    stream: int
    dgu: int

    def generator(self, block: int) -> np.random.Generator:
        """Return the generator of one block."""
        key = np.random.SeedSequence((self.seed, self.stream, self.dgu, block))
        return np.random.Generator(np.random.Philox(key))

    def values(self, first: int, stop: int, draw: Callable[[np.random.Generator], FloatArray]) -> FloatArray:
        """Return values first ... stop-1.

        Args:
            first: Index of the first value.
            stop: One past the last.
            draw: Draws one whole block, shape (BLOCK, ...).

        Returns:
            Shape (stop - first, ...).
        """
        start = first // BLOCK
        blocks = [draw(self.generator(block)) for block in range(start, (stop - 1) // BLOCK + 1)]
        joined = blocks[0] if len(blocks) == 1 else np.concatenate(blocks)
        return joined[first - start * BLOCK : stop - start * BLOCK]


def first_step(time_sec: float, sampling_period_sec: float) -> int:
    """Return the first step k with k T_s >= time_sec, forgiving the rounding of decimal fractions."""
    return int(np.ceil(time_sec / sampling_period_sec - 1e-6))
