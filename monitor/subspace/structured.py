"""Structured total least squares: the maximum-likelihood subspace, aware that every sample appears in two columns."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monitor.kernel import null_space
from monitor.subspace.total_least_squares import total_least_squares
from monitor.subspace.trajectories import Trajectories, join, split

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.history import DataMatrices

_TOLERANCE = 1e-15  # of the Gauss-Newton iteration, relative
_MOST = 60  # free numbers: the search for more takes minutes, and the total-least-squares start is taken


def structured(
    data: DataMatrices, unknown_inputs: int, weights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], ...]:
    """Parity rows P with P [x_t; x_t+1; u_t; u_t+1] = 0, fitted by maximum likelihood from the least-squares start.

    The parity error s_t = P_p w_t + P_f w_t+1 of white noise w is a moving average: its covariance Gamma(P) is block
    tridiagonal, and the likelihood asks for the least s' Gamma(P)^-1 s (variable projection). P is searched as
    P0 + K P0_orthogonal about the total-least-squares solution P0.
    """
    from scipy.optimize import least_squares  # noqa: PLC0415 (slow to import)

    m, n = len(data.U_p), len(data.X_p)
    start = total_least_squares(data, unknown_inputs, weights)
    if unknown_inputs >= n:
        return start
    scale = np.concatenate([np.tile(weights, 2), np.ones(2 * m)])
    L_u, L_x, L_uf, L_xf = start
    P0 = null_space((scale[:, None] * np.vstack([L_x, L_xf, L_u, L_uf])).T).T
    rows = scale[:, None] * np.vstack([data.X_p, data.X_f, data.U_p, data.U_f])
    around = null_space(P0).T
    joined = np.diff(data.positions) == 1

    def parity(K: NDArray[np.float64]) -> NDArray[np.float64]:
        return P0 + K.reshape(len(P0), -1) @ around

    def whitened(K: NDArray[np.float64]) -> NDArray[np.float64]:
        P = parity(K)
        return _whiten(P @ rows, P[:, :n], P[:, n : 2 * n], joined)

    free = len(P0) * len(around)
    if free > _MOST:
        return start
    # central differences to the end: where the search stops must not depend on the processor's rounding
    fitted = least_squares(whitened, np.zeros(free), jac="3-point", xtol=_TOLERANCE, ftol=_TOLERANCE, gtol=_TOLERANCE)
    P = parity(fitted.x) * scale
    return _trajectories_of(P, data)


def _whiten(
    s: NDArray[np.float64], P_p: NDArray[np.float64], P_f: NDArray[np.float64], joined: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """L^-1 s with L L' = Gamma; s (c, N) in columns that share a sample where `joined` says so."""
    from scipy.linalg import cholesky_banded, solve_banded  # noqa: PLC0415 (slow to import)

    c, N = s.shape
    here = P_p @ P_p.T + P_f @ P_f.T
    following = P_p @ P_f.T  # covariance of s_t+1 with s_t: both hold the noise of sample t + 1
    bands = np.zeros((2 * c, c * N))
    for offset in range(2 * c):
        for i in range(c):  # row i of a block column; entry (i + offset, i) of Gamma lies `offset` below the diagonal
            block, j = divmod(i + offset, c)
            if block == 0:
                bands[offset, i::c] = here[j, i]
            elif block == 1:
                bands[offset, i : c * (N - 1) : c] = np.where(joined, following[j, i], 0.0)
    lower = cholesky_banded(bands, lower=True)
    return np.asarray(solve_banded((2 * c - 1, 0), lower, s.T.ravel()))


def _trajectories_of(P: NDArray[np.float64], data: DataMatrices) -> tuple[NDArray[np.float64], ...]:
    """Basis (L_u, L_x, L_uf, L_xf) of the trajectories that the parity rows P allow, known inputs as recorded."""
    m, n = len(data.U_p), len(data.X_p)
    found = split(data)
    directions = null_space(P[:, : 2 * n])
    following = -np.linalg.pinv(P[:, : 2 * n]) @ P[:, 2 * n :] @ found.R
    return join(Trajectories(R=found.R, G=following, X=found.X), directions, m, n)
