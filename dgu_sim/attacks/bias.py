"""Additive bias."""

from collections.abc import Sequence

from pydantic import Field

from dgu_sim.attacks.context import AttackContext
from dgu_sim.attacks.falsified import shifted
from dgu_sim.attacks.protocol import Attack
from dgu_sim.model import Vector3
from dgu_sim.records import Sample

__all__ = ["Bias"]


class Bias(Attack):
    """y^c = y + phi with a constant phi on every sample, T (19): a step at the attack's start."""

    bias: Vector3 = Field(description="phi: what is added to V [V], I_t [A], v [V s] of every sample.")

    def init(self, context: AttackContext) -> object:
        """Return the state before the first affected sample: a bias remembers nothing."""
        del context
        return None

    def step(self, state: object, samples: Sequence[Sample]) -> tuple[object, tuple[Sample, ...]]:
        """Return the samples with phi added."""
        return state, shifted(samples, [self.bias] * len(samples))
