"""Total least squares: the best subspace when both ends of every step carry noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monitor.subspace.trajectories import join, split

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.history import DataMatrices


def total_least_squares(
    data: DataMatrices, unknown_inputs: int, weights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], ...]:
    """Dominant left singular subspace of [X_p; X_f] scaled to equal noise, weights (n,) = 1 / noise_std.

    Consistent for white noise of the given proportions: noise adds the same to every eigenvalue of the covariance and
    turns no eigenvector.
    """
    m, n = len(data.U_p), len(data.X_p)
    found = split(data)
    scale = np.tile(weights, 2)[:, None]
    directions = np.linalg.svd(scale * found.X, full_matrices=False)[0][:, : n + unknown_inputs]
    return join(found, directions / scale, m, n)
