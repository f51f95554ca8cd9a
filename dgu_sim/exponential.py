"""The matrix exponential with a fixed order of operations."""

import math

import numpy as np

from dgu_sim.linear import FloatArray

__all__ = ["expm"]

TERMS = 18
"""Taylor terms: with ||M|| <= 1/2 the first neglected one is below 2^-19 / 19! < 1e-22."""


def expm(M: FloatArray) -> FloatArray:
    """Return e^M of a square matrix by scaling and squaring of its Taylor series.

    Written with element-wise operations only. A BLAS product (and so `scipy.linalg.expm`) picks its kernel, and
    with it the order of its sums, by processor; two hosts of one run must discretise to the same bits.

    Args:
        M: Square matrix, shape (n, n), finite.

    Returns:
        e^M, shape (n, n).
    """
    norm = float(np.abs(M).sum(axis=0).max()) if M.size else 0.0
    squarings = max(0, math.frexp(norm)[1] + 1)
    scaled = M * 2.0**-squarings
    result = np.eye(len(M))
    for term in range(TERMS, 0, -1):  # Horner: I + M/1 (I + M/2 (I + ...))
        result = np.eye(len(M)) + _product(scaled, result) / term
    for _ in range(squarings):
        result = _product(result, result)
    return result


def _product(A: FloatArray, B: FloatArray) -> FloatArray:
    """Return A B as a sum of outer products in the order of the inner index."""
    total = np.zeros((A.shape[0], B.shape[1]))
    for k in range(A.shape[1]):
        total = total + A[:, k, np.newaxis] * B[k, :]
    return total
