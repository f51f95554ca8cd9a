"""Rank truncation: T's pseudo-inverse with the small singular values of the regressors cut off."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.history import DataMatrices


def truncation(
    data: DataMatrices, unknown_inputs: int, weights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], ...]:
    """Truncated basis of [U_p; Y_p; X_p; U_f; Y_f] with X_f regressed on it (X_f S_r^+); weights do not matter."""
    del weights
    m, p, n = len(data.U_p), len(data.Y_p), len(data.X_p)
    S = np.vstack([data.U_p, data.Y_p, data.X_p, data.U_f, data.Y_f])
    left, values, right = np.linalg.svd(S, full_matrices=False)
    rank = 2 * m + n + unknown_inputs
    L_u, _, L_x, L_uf, _ = np.split(left[:, :rank] * values[:rank], np.cumsum([m, p, n, m]))
    return L_u, L_x, L_uf, data.X_f @ right[:rank].T
