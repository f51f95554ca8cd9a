"""Current biases on several links that cancel in the mean voltage."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

from pydantic import AfterValidator, Field

from dgu_sim.attacks.context import AttackContext
from dgu_sim.attacks.falsified import shifted
from dgu_sim.attacks.protocol import Attack
from dgu_sim.errors import AttackError
from dgu_sim.grid import Link
from dgu_sim.linear import Vector
from dgu_sim.model import Number
from dgu_sim.records import Sample

__all__ = ["ZeroSum"]

_ROUNDING = 1e-9  # of the largest share: 0.1 + 0.2 - 0.3 is a zero sum


def _cancels(shares: tuple[float, ...]) -> tuple[float, ...]:
    if abs(sum(shares)) > _ROUNDING * max(abs(share) for share in shares):
        raise ValueError(f"expected numbers that add up to 0, found the sum {sum(shares):g}")
    return shares


@dataclass(frozen=True, slots=True, kw_only=True)
class _Biases:
    """The constant phi of each link."""

    phi: tuple[Vector, ...]


class ZeroSum(Attack):
    """phi_I = share * I^r of the link's source, the shares add up to 0.

    d<V>/dt = k_I sum(phi_I / I^r) / N (theory section 2) is then 0: the sharing is distorted, the mean voltage is not
    moved.
    """

    knows: ClassVar[str] = "the rated currents"

    shares: Annotated[tuple[Number, ...], AfterValidator(_cancels)] = Field(
        min_length=2, description="phi_I / I^r of each link, in the order of `links`; they add up to 0."
    )

    def check_links(self, links: Sequence[Link]) -> None:
        """Check that there is one share for each link."""
        if len(links) != len(self.shares):
            raise AttackError(f"expected {len(self.shares)} links, one for each of the shares, found {len(links)}")

    def init(self, context: AttackContext) -> object:
        """Return the phi of each link."""
        knowledge = context.knowledge
        currents = [
            share * knowledge.rated_current(link.source) for share, link in zip(self.shares, context.links, strict=True)
        ]
        return _Biases(phi=tuple((0.0, current, 0.0) for current in currents))

    def step(self, state: object, samples: Sequence[Sample]) -> tuple[object, tuple[Sample, ...]]:
        """Return the samples with phi added."""
        assert isinstance(state, _Biases)  # noqa: S101 - what init returned
        return state, shifted(samples, state.phi)
