"""What one DGU and its surroundings tell each other in one step."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from dgu_sim.linear import Component, Truth, Vector

__all__ = ["Physical", "Sample", "heard"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """One measured output on a communication link.

    Attributes:
        y: V [V], I_t [A], v [V s]; NaN where a component is not sent.
        delivered: False where the link lost the sample.
        u: Known inputs that act on the sender from this sample on; a DGU has none.
    """

    y: Vector
    delivered: Truth = True
    u: Vector = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Physical:
    """The true state of a physically coupled DGU: it acts through the lines and cannot be attacked.

    Attributes:
        x: V [V], I_t [A], v [V s] at step k.
        load_current: I_L held over step k [A].
        reference: V_ref + alpha held over step k [V].
    """

    x: Vector
    load_current: Component
    reference: Component


def heard(received: Sequence[Sample], dropped: Sequence[Truth]) -> list[Sample]:
    """Return what secondary control hears of one step: a sample that is left out counts as not delivered."""
    return [replace(sample, delivered=False) if out else sample for sample, out in zip(received, dropped, strict=True)]
