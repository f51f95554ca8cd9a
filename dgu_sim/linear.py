"""Components: the same code, and the same bits, for one float and for a thousand runs.

A component is a float or an array with any leading axes (runs, DGUs, links); a vector is a sequence of
components, or an array with the components on its first axis. Everything is written as element-wise multiply
and add in a fixed order, because BLAS and einsum round differently for different array shapes.
"""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["Component", "FloatArray", "Truth", "Vector", "add", "choose", "stack", "stack_vectors"]

FloatArray: TypeAlias = NDArray[np.float64]
Component: TypeAlias = float | FloatArray
Truth: TypeAlias = bool | NDArray[np.bool_]
Vector: TypeAlias = Sequence[Component] | FloatArray


def add(x: Vector, y: Vector) -> Vector:
    """Return x + y."""
    if isinstance(x, np.ndarray) and isinstance(y, np.ndarray):
        return x + y
    return tuple([a + b for a, b in zip(x, y, strict=True)])


def choose(condition: Truth, yes: Component, no: Component) -> Component:
    """Return `yes` where the condition holds and `no` elsewhere."""
    if isinstance(condition, np.ndarray):
        return np.where(condition, yes, no)
    return yes if condition else no


def stack(values: Sequence[Component]) -> FloatArray:
    """Turn one float for each DGU into one component of shape (1, DGUs).

    The leading 1 is for speed: numpy takes its fast path when one run meets coefficients of its own shape.
    """
    return np.array([values], dtype=np.float64)


def stack_vectors(vectors: Sequence[Vector]) -> tuple[FloatArray, ...]:
    """Turn one vector of floats for each DGU into one vector of components of shape (1, DGUs)."""
    return tuple(stack(values) for values in zip(*vectors, strict=True))
