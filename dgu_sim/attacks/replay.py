"""Yesterday's measurements."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pydantic import Field

from dgu_sim.attacks.context import AttackContext
from dgu_sim.attacks.protocol import Attack
from dgu_sim.model import Number
from dgu_sim.records import Sample

__all__ = ["Replay"]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Tape:
    """What is recorded, how many samples it will hold, and the next one to play."""

    length: int
    recorded: tuple[tuple[Sample, ...], ...]
    position: int


class Replay(Attack):
    """Records the first record_sec unchanged, then plays them back in a loop: y^c_k = y_(k0 + (k - k0) mod n).

    The attack starts with the recording; the first falsified sample comes record_sec later.
    """

    record_sec: Number = Field(gt=0, description="Length of the recording [s], at least one sample.")

    def init(self, context: AttackContext) -> object:
        """Return the empty tape."""
        length = max(1, round(self.record_sec / context.sampling_period_sec))
        return _Tape(length=length, recorded=(), position=0)

    def step(self, state: object, samples: Sequence[Sample]) -> tuple[object, tuple[Sample, ...]]:
        """Return the samples while recording, then the recorded ones."""
        assert isinstance(state, _Tape)  # noqa: S101 - what init returned
        if len(state.recorded) < state.length:
            return replace(state, recorded=(*state.recorded, tuple(samples))), tuple(samples)
        return replace(state, position=(state.position + 1) % state.length), state.recorded[state.position]
