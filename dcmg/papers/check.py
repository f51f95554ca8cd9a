"""One number of a paper's experiment against what it should be."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """A computed number and its expectation.

    Attributes:
        name: what it is.
        value: what came out.
        expected: what should.
        tolerance: largest accepted |value - expected|.
    """

    name: str
    value: float
    expected: float
    tolerance: float

    @property
    def ok(self) -> bool:
        """Whether they agree."""
        return bool(abs(self.value - self.expected) <= self.tolerance)
