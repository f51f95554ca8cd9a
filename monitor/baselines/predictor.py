"""The predictor form that the Luenberger observer and the Kalman filter share."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monitor.linear_observer import LinearObserver

if TYPE_CHECKING:
    from numpy.typing import NDArray


def predictor(
    A: NDArray[np.float64], G: NDArray[np.float64], C: NDArray[np.float64], L: NDArray[np.float64]
) -> LinearObserver:
    """z+ = (A - L C) z + G u + L y, xhat = z, r = y - C z; starts from the pseudo-inverse guess C^+ y."""
    n, m, p = len(A), G.shape[1], len(C)
    return LinearObserver(
        A=A - L @ C,
        B=np.hstack([G, L]),
        M=np.eye(n),
        D=np.zeros((n, m + p)),
        H=-C,
        J=np.hstack([np.zeros((p, m)), np.eye(p)]),
        Z=np.hstack([np.zeros((n, m)), np.linalg.pinv(C)]),
        inputs=m,
        outputs=p,
    )
