"""Additive bias."""

from collections.abc import Sequence

from pydantic import Field

from dgu_sim.attacks.protocol import Attack
from dgu_sim.linear import add
from dgu_sim.model import Vector3
from dgu_sim.records import Sample

__all__ = ["Bias"]


class Bias(Attack):
    """y^c = y + phi with a constant phi on every sample, T (19)."""

    bias: Vector3 = Field(description="phi: what is added to V [V], I_t [A], v [V s].")

    def init(self) -> object:
        """Return the state before the first affected sample: a bias remembers nothing."""
        return None

    def step(self, state: object, samples: Sequence[Sample]) -> tuple[object, tuple[Sample, ...]]:
        """Return the samples with phi added."""
        return state, tuple(Sample(y=add(sample.y, self.bias), delivered=sample.delivered) for sample in samples)
