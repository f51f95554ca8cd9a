"""x+ = A x + E d of one pair of DGUs, for one pair in floats or for all DGUs in arrays."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np

from dgu_sim.linear import Component, FloatArray, Vector

__all__ = ["GridTransition", "PairTransition", "Row", "Transition", "stack_transitions"]

Row: TypeAlias = tuple[float, float, float, float, float]
"""One row of [A E]."""


class Transition(Protocol):
    """A x + E d, summed in the order V, I_t, v, d_1, d_2."""

    def apply(self, x: Vector, current: Component, reference: Component) -> Vector:
        """Return A x + E d for x = [V, I_t, v] and d = [current, reference]."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class PairTransition:
    """In floats.

    Attributes:
        rows: [A E], 3 rows.
    """

    rows: tuple[Row, ...]

    def apply(self, x: Vector, current: Component, reference: Component) -> Vector:
        """Return A x + E d, three components."""
        V, I_t, v = x
        return tuple([a * V + b * I_t + c * v + d * current + e * reference for a, b, c, d, e in self.rows])


@dataclass(frozen=True, slots=True, kw_only=True)
class GridTransition:
    """In arrays: the same products and sums for all DGUs and all three rows at once.

    Attributes:
        columns: [A E], 5 columns of shape (3, 1, DGUs).
    """

    columns: tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]

    def apply(self, x: Vector, current: Component, reference: Component) -> Vector:
        """Return A x + E d, shape (3, runs, DGUs)."""
        a, b, c, d, e = self.columns
        return a * x[0] + b * x[1] + c * x[2] + d * current + e * reference


def stack_transitions(transitions: Sequence[PairTransition]) -> GridTransition:
    """Turn one transition for each DGU into one for all of them."""
    rows = np.array([one.rows for one in transitions])  # (DGUs, 3, 5)
    a, b, c, d, e = (np.ascontiguousarray(rows[:, :, column].T[:, np.newaxis, :]) for column in range(5))
    return GridTransition(columns=(a, b, c, d, e))
