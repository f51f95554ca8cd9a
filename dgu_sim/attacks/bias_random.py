"""A bias that is noise."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from pydantic import Field

from dgu_sim.attacks.context import AttackContext
from dgu_sim.attacks.falsified import shifted
from dgu_sim.attacks.protocol import Attack
from dgu_sim.linear import Component, FloatArray
from dgu_sim.model import Spread3
from dgu_sim.records import Sample
from dgu_sim.signals import BLOCK

__all__ = ["BiasRandom"]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Drawn:
    """Samples since the start, and the numbers of the block around: 3 BLOCK components for each link."""

    context: AttackContext
    elapsed: int
    numbers: tuple[Sequence[Component], ...]


class BiasRandom(Attack):
    """y^c = y + phi, phi drawn anew for every sample, component and link: U(-spread, spread) or N(0, spread^2).

    The numbers are a pure function of the run's seed, the attack's number, the link and the sample.
    """

    spread: Spread3 = Field(
        description="Half-width (uniform) or standard deviation (gaussian) on V [V], I_t [A], v [V s]."
    )
    distribution: Literal["uniform", "gaussian"] = Field(default="uniform", description="`uniform` or `gaussian`.")

    def init(self, context: AttackContext) -> object:
        """Return the first block of numbers."""
        return self._drawn(context, 0)

    def step(self, state: object, samples: Sequence[Sample]) -> tuple[object, tuple[Sample, ...]]:
        """Return the samples with phi added."""
        assert isinstance(state, _Drawn)  # noqa: S101 - what init returned
        first = 3 * (state.elapsed % BLOCK)
        following = state.elapsed + 1
        changed = shifted(samples, [numbers[first : first + 3] for numbers in state.numbers])
        if following % BLOCK:
            return replace(state, elapsed=following), changed
        return self._drawn(state.context, following), changed

    def _drawn(self, context: AttackContext, elapsed: int) -> _Drawn:
        slots = range(len(context.links))
        numbers = tuple(context.draw(slot, elapsed // BLOCK, self._draw) for slot in slots)
        return _Drawn(context=context, elapsed=elapsed, numbers=numbers)

    def _draw(self, generator: np.random.Generator) -> FloatArray:
        shape = (BLOCK, 3)
        drawn = generator.standard_normal(shape) if self.distribution == "gaussian" else generator.uniform(-1, 1, shape)
        return (drawn * self.spread).ravel()
