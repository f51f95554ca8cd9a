"""Coordinated voltage biases that cancel in the receiver's observer of its own state."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from pydantic import Field

from dgu_sim.attacks.context import AttackContext
from dgu_sim.attacks.falsified import shifted
from dgu_sim.attacks.protocol import Attack
from dgu_sim.errors import AttackError
from dgu_sim.grid import Link
from dgu_sim.linear import Vector
from dgu_sim.model import Number
from dgu_sim.records import Sample

__all__ = ["LuenbergerStealthy"]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Biases:
    """The constant phi of each link."""

    phi: tuple[Vector, ...]


class LuenbergerStealthy(Attack):
    """sum_j A_ij phi_ij = 0, theory section 8: phi_V on the first link, the opposite line current on the others.

    A_ij acts on V only and is proportional to 1/R_ij, so with g = 1/R_ij and m links into one DGU,
    phi_V,j = -phi_V,1 g_1 / ((m - 1) g_j) for j = 2 ... m.
    """

    knows: ClassVar[str] = "the resistances of the receiver's lines"

    voltage_v: Number = Field(description="phi_V on the first link [V]; those on the others follow.")

    def check_links(self, links: Sequence[Link]) -> None:
        """Check that there are several links, into one DGU."""
        if len(links) < 2 or len({link.target for link in links}) > 1:  # noqa: PLR2004 - one cannot cancel itself
            found = ", ".join(str(link) for link in links)
            raise AttackError(f"expected at least two links into one DGU, found {found}")

    def init(self, context: AttackContext) -> object:
        """Return the phi of each link."""
        first, *others = [context.knowledge.conductance(link) for link in context.links]
        voltages = [self.voltage_v, *(-self.voltage_v * first / (len(others) * other) for other in others)]
        return _Biases(phi=tuple((voltage, 0.0, 0.0) for voltage in voltages))

    def step(self, state: object, samples: Sequence[Sample]) -> tuple[object, tuple[Sample, ...]]:
        """Return the samples with phi added."""
        assert isinstance(state, _Biases)  # noqa: S101 - what init returned
        return state, shifted(samples, state.phi)
