"""An attack that swings the voltage."""

from collections.abc import Sequence

from pydantic import Field

from dgu_sim.attacks import Attack, AttackContext
from dgu_sim.attacks.falsified import shifted
from dgu_sim.records import Sample


class Wobble(Attack):
    """Adds +voltage_v and -voltage_v by turns to every second sample."""

    voltage_v: float = Field(gt=0.0, description="What is added to V by turns, and taken away [V].")

    def init(self, context: AttackContext) -> object:
        """Return the number of samples that have passed."""
        del context
        return 0

    def step(self, state: object, samples: Sequence[Sample]) -> tuple[object, tuple[Sample, ...]]:
        """Return the samples with V shifted: up, not at all, down, not at all, up..."""
        assert isinstance(state, int)
        turn = (1.0, 0.0, -1.0, 0.0)[state % 4]
        return state + 1, shifted(samples, [(turn * self.voltage_v, 0.0, 0.0)] * len(samples))
