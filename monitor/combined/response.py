"""How long an accused link is left out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from monitor.linear import larger, select

if TYPE_CHECKING:
    from collections.abc import Sequence

    from monitor.linear import Flag, Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """An accused link is left out from that very sample on, until so many samples without an accusation have passed.

    Attributes:
        quiet_steps: samples without an accusation after which a link is heard again.
    """

    quiet_steps: int

    def init(self, links: int) -> Vector:
        """State before the first sample: for how many more samples each link is left out."""
        return (0.0,) * links

    def step(self, state: Vector, accused: Sequence[Flag]) -> tuple[Vector, tuple[Flag, ...]]:
        """Take the accusations of one step: the next state and the links that are left out at this step."""
        left = tuple(
            [
                select(flag, self.quiet_steps + 1.0, larger(0.0, remaining - 1.0))
                for remaining, flag in zip(state, accused, strict=True)
            ]
        )
        return left, tuple([remaining > 0.0 for remaining in left])
