"""Component algebra: the same bits for Python floats and for arrays over (runs, links).

A component is a float or an array with axes (runs, links). A vector is a sequence of components, or an array whose
first axis numbers them; a matrix is a tuple of rows of floats, or an array (rows, columns, 1, links) for many links at
once. Every product is an element-wise multiply-add in a fixed order: BLAS and einsum would round differently for
different shapes.
"""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Sequence

Component: TypeAlias = float | NDArray[np.float64]
Flag: TypeAlias = bool | NDArray[np.bool_]
Count: TypeAlias = int | NDArray[np.int64]
Vector: TypeAlias = "Sequence[Component] | NDArray[np.float64]"
Matrix: TypeAlias = tuple[tuple[float, ...], ...] | NDArray[np.float64]


def rows_of(matrix: NDArray[np.float64]) -> tuple[tuple[float, ...], ...]:
    """Turn an array (rows, columns) into the rows of Python floats that `matvec` multiplies fastest."""
    return tuple(tuple(float(entry) for entry in row) for row in matrix)


def matvec(matrix: Matrix, vector: Vector) -> Vector:
    """Multiply a matrix by a vector of components, summing from 0.0 over the columns in order."""
    if isinstance(matrix, tuple):
        return _matvec_six(matrix, vector) if len(vector) == _SIX else _matvec_rows(matrix, vector)
    accumulated = np.zeros(())
    for column in range(matrix.shape[1]):
        accumulated = accumulated + matrix[:, column] * vector[column]
    return accumulated


_SIX = 6  # order 3 and 3 outputs: every full-order observer of a DGU


def _matvec_six(matrix: tuple[tuple[float, ...], ...], vector: Vector) -> Vector:
    """The sums of `_matvec_rows` written out, three times as fast."""
    v0, v1, v2, v3, v4, v5 = vector
    return tuple([0.0 + a * v0 + b * v1 + c * v2 + d * v3 + e * v4 + f * v5 for a, b, c, d, e, f in matrix])


def _matvec_rows(matrix: tuple[tuple[float, ...], ...], vector: Vector) -> Vector:
    product: list[Component] = []
    for row in matrix:
        total: Component = 0.0
        for entry, component in zip(row, vector, strict=True):
            total = total + entry * component
        product.append(total)
    return tuple(product)


def select(condition: Flag, chosen: Component, other: Component) -> Component:
    """Take `chosen` where the condition holds and `other` elsewhere."""
    if isinstance(condition, bool):
        return chosen if condition else other
    return np.where(condition, chosen, other)


def anywhere(flag: Flag) -> bool:
    """Tell whether a condition holds for any run or link: where it holds for none, its branch need not be computed."""
    return bool(flag.any()) if isinstance(flag, np.ndarray) else bool(flag)


def everywhere(flag: Flag) -> bool:
    """Tell whether a condition holds for every run and link."""
    return bool(flag.all()) if isinstance(flag, np.ndarray) else bool(flag)


def larger(first: Component, second: Component) -> Component:
    """Take the larger component; a NaN in `second` leaves `first`."""
    return select(first < second, second, first)


def is_missing(component: Component) -> Flag:
    """Tell whether a component is NaN, the mark of a value that is not there."""
    return component != component  # noqa: PLR0124 - the one test for NaN that floats and arrays share


def is_finite(component: Component) -> Flag:
    """Tell whether a component is a number that can be computed with."""
    return (component > -inf) & (component < inf)


def negated(flag: Flag) -> Flag:
    """Turn a condition into its opposite."""
    return np.logical_not(flag) if isinstance(flag, np.ndarray) else not flag
