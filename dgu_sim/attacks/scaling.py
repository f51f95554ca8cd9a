"""Multiplied measurements."""

from collections.abc import Sequence

from pydantic import Field

from dgu_sim.attacks.context import AttackContext
from dgu_sim.attacks.protocol import Attack
from dgu_sim.model import Vector3
from dgu_sim.records import Sample

__all__ = ["Scaling"]


class Scaling(Attack):
    """y^c_k = gain_k y_k for each component."""

    gain: Vector3 = Field(description="Factors on V, I_t, v; 1 leaves a component as it is.")

    def init(self, context: AttackContext) -> object:
        """Return the state before the first affected sample: it remembers nothing."""
        del context
        return None

    def step(self, state: object, samples: Sequence[Sample]) -> tuple[object, tuple[Sample, ...]]:
        """Return the scaled samples."""
        return state, tuple(
            Sample(
                y=tuple([gain * component for gain, component in zip(self.gain, sample.y, strict=True)]),
                delivered=sample.delivered,
            )
            for sample in samples
        )
