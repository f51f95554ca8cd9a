"""Linear algebra on components: the same bits for one float and for a thousand runs.

A component is a float or an array with any leading axes (runs, DGUs, links); a vector is a sequence of
components, a matrix a sequence of rows. Everything is written as element-wise multiply and add in a fixed
order, because BLAS and einsum round differently for different array shapes.
"""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["Component", "FloatArray", "Matrix", "Truth", "Vector", "add", "choose", "dot", "matvec", "stack_matrices"]

FloatArray: TypeAlias = NDArray[np.float64]
Component: TypeAlias = float | FloatArray
Truth: TypeAlias = bool | NDArray[np.bool_]
Vector: TypeAlias = Sequence[Component] | FloatArray
Matrix: TypeAlias = Sequence[Vector]


def dot(row: Vector, x: Vector) -> Component:
    """Return sum_j row_j x_j, summed from 0.0 in the order of j."""
    total: Component = 0.0
    for a, b in zip(row, x, strict=True):
        total = total + a * b
    return total


def matvec(M: Matrix, x: Vector) -> tuple[Component, ...]:
    """Return M x, one component for each row of M."""
    return tuple([dot(row, x) for row in M])


def add(x: Vector, y: Vector) -> tuple[Component, ...]:
    """Return x + y."""
    return tuple([a + b for a, b in zip(x, y, strict=True)])


def choose(condition: Truth, yes: Component, no: Component) -> Component:
    """Return `yes` where the condition holds and `no` elsewhere."""
    if isinstance(condition, np.ndarray):
        return np.where(condition, yes, no)
    return yes if condition else no


def stack_matrices(matrices: Sequence[Matrix]) -> tuple[tuple[FloatArray, ...], ...]:
    """Turn one matrix of floats for each DGU into one matrix whose components have a last axis "DGUs"."""
    columns = range(len(matrices[0][0]))
    return tuple(
        tuple(np.array([M[i][j] for M in matrices], dtype=np.float64) for j in columns) for i in range(len(matrices[0]))
    )
