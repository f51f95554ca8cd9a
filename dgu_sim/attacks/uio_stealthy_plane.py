"""The constant bias that leaves no steady residual in an unknown-input observer."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from pydantic import Field

from dgu_sim.attacks.context import AttackContext
from dgu_sim.attacks.falsified import shifted
from dgu_sim.attacks.parity import Parity, Source, parities_of
from dgu_sim.attacks.protocol import Attack
from dgu_sim.linear import Vector
from dgu_sim.model import Number
from dgu_sim.records import Sample

__all__ = ["UioStealthyPlane"]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Plane:
    """The constant phi of each link."""

    phi: tuple[Vector, ...]


class UioStealthyPlane(Attack):
    """Constant phi with (past + future) . phi = 0: it shows for a blip and leaves no steady residual.

    With the model this is (k1-1) phi_V + (k2-R_t) phi_I + k3 phi_v = 0, theory section 3. phi_V and phi_I are chosen,
    phi_v follows.
    """

    knows: ClassVar[str] = "the victim's recorded history, or its model"

    voltage_v: Number = Field(default=0.0, description="phi_V [V].")
    current_a: Number = Field(default=0.0, description="phi_I [A]: what moves the grid.")
    knowledge: Source = Field(
        default=Source.HISTORY, description="Where phi_v is computed from: `history` (recorded) or `model`."
    )

    def init(self, context: AttackContext) -> object:
        """Return the phi of each link."""
        return _Plane(phi=tuple(self._phi(parity) for parity in parities_of(context, self.knowledge)))

    def step(self, state: object, samples: Sequence[Sample]) -> tuple[object, tuple[Sample, ...]]:
        """Return the samples with phi added."""
        assert isinstance(state, _Plane)  # noqa: S101 - what init returned
        return state, shifted(samples, state.phi)

    def _phi(self, parity: Parity) -> Vector:
        V, I_t, v = [past + future for past, future in zip(parity.past, parity.future, strict=True)]
        return self.voltage_v, self.current_a, -(V * self.voltage_v + I_t * self.current_a) / v
