"""A link that stands still."""

from collections.abc import Sequence

from dgu_sim.attacks.context import AttackContext
from dgu_sim.attacks.protocol import Attack
from dgu_sim.records import Sample

__all__ = ["Freeze"]


class Freeze(Attack):
    """y^c_k = y_k0: the first sample of the attack is delivered again and again."""

    def init(self, context: AttackContext) -> object:
        """Return the state before the first affected sample: nothing is held."""
        del context
        return None

    def step(self, state: object, samples: Sequence[Sample]) -> tuple[object, tuple[Sample, ...]]:
        """Return the samples held."""
        held = tuple(samples) if state is None else state
        assert isinstance(held, tuple)  # noqa: S101 - the state is what the first step left
        return held, held
