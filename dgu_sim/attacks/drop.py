"""Lost messages: a faulty link, or denial of service."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from dgu_sim.attacks.context import AttackContext
from dgu_sim.attacks.falsified import lost_where
from dgu_sim.attacks.protocol import Attack
from dgu_sim.linear import Component, FloatArray
from dgu_sim.model import Number
from dgu_sim.records import Sample
from dgu_sim.signals import BLOCK

__all__ = ["Drop"]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Drawn:
    """Samples since the start, and U(0, 1) of each sample of the block around, for each link."""

    context: AttackContext
    elapsed: int
    chance: tuple[Sequence[Component], ...]


class Drop(Attack):
    """Each sample is lost with a probability, independently; with probability 1 none gets through (DoS).

    A lost sample is delivered as "not delivered": y = NaN and delivered = false, so nobody waits for it. A window is
    the attack's start and stop. The draws are a pure function of seed, attack number, link and sample.
    """

    probability: Number = Field(default=1.0, gt=0, le=1, description="Share of the samples that is lost, 0 to 1.")

    def init(self, context: AttackContext) -> object:
        """Return the first block of draws."""
        return _drawn(context, 0)

    def step(self, state: object, samples: Sequence[Sample]) -> tuple[object, tuple[Sample, ...]]:
        """Return the samples, some of them lost."""
        assert isinstance(state, _Drawn)  # noqa: S101 - what init returned
        offset, following = state.elapsed % BLOCK, state.elapsed + 1
        changed = tuple(
            lost_where(chance[offset] < self.probability, sample)
            for chance, sample in zip(state.chance, samples, strict=True)
        )
        if following % BLOCK:
            return replace(state, elapsed=following), changed
        return _drawn(state.context, following), changed


def _drawn(context: AttackContext, elapsed: int) -> _Drawn:
    slots = range(len(context.links))
    chance = tuple(context.draw(slot, elapsed // BLOCK, _uniform) for slot in slots)
    return _Drawn(context=context, elapsed=elapsed, chance=chance)


def _uniform(generator: np.random.Generator) -> FloatArray:
    return generator.random(BLOCK)
