"""What an attack is told when it is set up: where it acts, its random numbers, and what the attacker knows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dgu_sim.errors import AttackError
from dgu_sim.grid import Link
from dgu_sim.linear import Component, FloatArray
from dgu_sim.signals import RandomSource, Stream

__all__ = ["AttackContext", "Knowledge"]


class Knowledge(Protocol):
    """What attackers can find out; an attack asks for no more than its documentation says."""

    def model(self, dgu: int) -> tuple[FloatArray, FloatArray]:
        """Return A (3, 3) and E (3, 2) of one DGU with its lines, x+ = A x + E d."""
        ...

    def history(self, dgu: int, seed: int) -> Sequence[FloatArray]:
        """Return the states (T, 3) of each recorded experiment of one DGU, in the run of a seed."""
        ...

    def conductance(self, link: Link) -> float:
        """Return 1/R_ij [S] of the power line along a link."""
        ...

    def keeps(self, dgu: int) -> tuple[str, ...]:
        """Return the components of its output that one DGU does not send: what listening on its links shows."""
        ...

    def rated_current(self, dgu: int) -> float:
        """Return I^r [A] of one DGU."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class AttackContext:
    """Where an attack acts.

    Attributes:
        links: The attacked links, in the order of the samples.
        sampling_period_sec: T_s.
        number: Number of the attack within the run: attacks draw independent random numbers.
        seed: Seed of the run whose samples are floats, or the seeds of runs whose samples are arrays (runs,).
        insight: What the attacker can find out; None: nothing.
    """

    links: tuple[Link, ...]
    sampling_period_sec: float
    number: int = 1
    seed: int | tuple[int, ...] = 0
    insight: Knowledge | None = None

    @property
    def knowledge(self) -> Knowledge:
        """What the attacker can find out.

        Raises:
            AttackError: Nothing is known here: a relay without a scenario.
        """
        if self.insight is None:
            raise AttackError("the attack needs knowledge of the grid: expected a relay that belongs to a scenario")
        return self.insight

    def each_run(self, values: Callable[[int], FloatArray]) -> list[Component]:
        """Return the numbers `values(seed)`, shape (n,), as n components: floats, or arrays over the runs."""
        if isinstance(self.seed, int):
            return [float(value) for value in values(self.seed)]
        return list(np.ascontiguousarray(np.array([values(seed) for seed in self.seed]).T))

    def draw(self, slot: int, block: int, draw: Callable[[np.random.Generator], FloatArray]) -> Sequence[Component]:
        """Return one block of random numbers of one of the attack's links.

        Args:
            slot: Position of the link in `links`.
            block: Number of the block.
            draw: Draws one whole block, shape (n,).

        Returns:
            n components: floats, or arrays over the runs with the same bits.
        """
        return self.each_run(
            lambda seed: draw(RandomSource(seed=seed, stream=Stream.ATTACK + self.number, dgu=slot).generator(block))
        )
