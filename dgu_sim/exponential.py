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

    P = e^M - I is what is squared, (I + P)^2 - I = 2 P + P^2: near I its small entries, the slow modes of a stiff
    plant, would drown in the rounding of the ones. On G's joint grid the error is 3e-14, scipy's 2e-12.

    Args:
        M: Square matrix, shape (n, n), finite.

    Returns:
        e^M, shape (n, n).
    """
    norm = float(np.abs(M).sum(axis=0).max()) if M.size else 0.0
    squarings = max(0, math.frexp(norm)[1] + 1)
    scaled = M * 2.0**-squarings
    P = scaled / TERMS
    for term in range(TERMS - 1, 0, -1):  # Horner: e^S - I = S/1 (I + S/2 (I + ...))
        P = (scaled + _product(scaled, P)) / term
    for _ in range(squarings):
        P = 2.0 * P + _product(P, P)
    identity: FloatArray = np.eye(len(M))
    return identity + P


def _product(A: FloatArray, B: FloatArray) -> FloatArray:
    """Return A B as a sum of outer products in the order of the inner index."""
    total = np.zeros((A.shape[0], B.shape[1]))
    for k in range(A.shape[1]):
        total = total + A[:, k, np.newaxis] * B[k, :]
    return total
