"""A falsification that no unknown-input observer of the victim can see at any step."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

from pydantic import Field

from dgu_sim.attacks.context import AttackContext
from dgu_sim.attacks.falsified import shifted
from dgu_sim.attacks.parity import Parity, Source, parities_of
from dgu_sim.attacks.protocol import Attack
from dgu_sim.linear import Component, Vector
from dgu_sim.model import Number
from dgu_sim.records import Sample

__all__ = ["UioStealthyTrajectory"]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Course:
    """Samples since the start, T_s, the relation of each link's source, and its phi at the last sample."""

    elapsed: int
    sampling_period_sec: float
    parities: tuple[Parity, ...]
    phi: tuple[Vector, ...]


class UioStealthyTrajectory(Attack):
    """phi_k+1 = A phi_k + E delta_k from phi = 0, theory section 3: what a load and a reference could have caused.

    These are the phi with past . phi_k + future . phi_k+1 = 0. phi_V and phi_I rise linearly to their targets in
    rise_sec and stay; phi_v follows from the relation.
    """

    knows: ClassVar[str] = "the victim's recorded history, or its model"

    voltage_v: Number = Field(default=0.0, description="phi_V at the end of the rise [V].")
    current_a: Number = Field(default=0.0, description="phi_I at the end of the rise [A]: what moves the grid.")
    rise_sec: Number = Field(default=1.0, gt=0, description="Time of the rise [s].")
    knowledge: Source = Field(
        default=Source.HISTORY, description="Where phi_v is computed from: `history` (recorded) or `model`."
    )

    def init(self, context: AttackContext) -> object:
        """Return phi = 0 before the first affected sample."""
        parities = parities_of(context, self.knowledge)
        return _Course(
            elapsed=0,
            sampling_period_sec=context.sampling_period_sec,
            parities=parities,
            phi=((0.0, 0.0, 0.0),) * len(parities),
        )

    def step(self, state: object, samples: Sequence[Sample]) -> tuple[object, tuple[Sample, ...]]:
        """Return the samples with phi added."""
        assert isinstance(state, _Course)  # noqa: S101 - what init returned
        elapsed = state.elapsed + 1
        share = min(1.0, elapsed * state.sampling_period_sec / self.rise_sec)
        V, I_t = share * self.voltage_v, share * self.current_a
        phi = tuple(
            (V, I_t, _last(parity, before, V, I_t)) for parity, before in zip(state.parities, state.phi, strict=True)
        )
        return replace(state, elapsed=elapsed, phi=phi), shifted(samples, phi)


def _last(parity: Parity, before: Vector, V: float, I_t: float) -> Component:
    """Return phi_v of the relation, whose coefficient of it is -1."""
    a, b, c = parity.past
    d, e, _ = parity.future
    return a * before[0] + b * before[1] + c * before[2] + d * V + e * I_t
