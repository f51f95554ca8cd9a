"""Old news."""

from collections.abc import Sequence

from pydantic import Field

from dgu_sim.attacks.context import AttackContext
from dgu_sim.attacks.protocol import Attack
from dgu_sim.records import Sample

__all__ = ["Delay"]

_LONGEST = 100_000  # samples held back for each link: some ten megabytes


class Delay(Attack):
    """y^c_k = y_(k - samples); until the delay line is full, the first sample of the attack is delivered."""

    samples: int = Field(ge=1, le=_LONGEST, description="How many samples late every sample is, up to 100000.")

    def init(self, context: AttackContext) -> object:
        """Return the empty delay line."""
        del context
        return ()

    def step(self, state: object, samples: Sequence[Sample]) -> tuple[object, tuple[Sample, ...]]:
        """Return the oldest samples held back."""
        assert isinstance(state, tuple)  # noqa: S101 - what init returned
        line = (*state[-self.samples :], tuple(samples))
        return line, line[0]
