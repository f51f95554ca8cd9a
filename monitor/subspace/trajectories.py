"""Known inputs are exact, states carry noise: splitting the data so that only the states are fitted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.history import DataMatrices


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectories:
    """[U_p; U_f] = R Q with orthonormal rows Q, and [X_p; X_f] = G Q + X, X orthogonal to Q.

    Attributes:
        R: (2m, 2m).
        G: (2n, 2m) how the states follow the known inputs.
        X: (2n, N) what the known inputs do not explain.
    """

    R: NDArray[np.float64]
    G: NDArray[np.float64]
    X: NDArray[np.float64]


def split(data: DataMatrices) -> Trajectories:
    """Project the exactly known inputs out of the states."""
    states = np.vstack([data.X_p, data.X_f])
    rows, R = np.linalg.qr(np.vstack([data.U_p, data.U_f]).T)
    G = states @ rows
    return Trajectories(R=R.T, G=G, X=states - G @ rows.T)


def join(found: Trajectories, directions: NDArray[np.float64], m: int, n: int) -> tuple[NDArray[np.float64], ...]:
    """Basis (L_u, L_x, L_uf, L_xf) from the directions (2n, n + m_d) in which the unexplained states move."""
    free = np.zeros((2 * m, directions.shape[1]))
    whole = np.block([[found.R, free], [found.G, directions]])
    U_p, U_f, X_p, X_f = np.split(whole, [m, 2 * m, 2 * m + n])
    return U_p, X_p, U_f, X_f
