"""Least squares one step ahead, then the main directions of what is left: noise at the start of a step is ignored."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monitor.subspace.trajectories import join, split

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.history import DataMatrices


def regression(
    data: DataMatrices, unknown_inputs: int, weights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], ...]:
    """X_f = A X_p + E D_p with A by least squares and range E the dominant directions of the innovations."""
    m, n = len(data.U_p), len(data.X_p)
    found = split(data)
    X_p, X_f = found.X[:n], found.X[n:]
    A = X_f @ np.linalg.pinv(X_p)
    left = np.linalg.svd(weights[:, None] * (X_f - A @ X_p), full_matrices=False)[0]
    E = left[:, :unknown_inputs] / weights[:, None]
    directions = np.block([[np.eye(n), np.zeros((n, unknown_inputs))], [A, E]])
    return join(found, directions, m, n)
