"""Stationary Kalman filter: the unknown input taken for white noise about a known mean."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_discrete_are

from monitor.baselines.predictor import predictor

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.baselines.model import Model
    from monitor.linear_observer import LinearObserver


def kalman(model: Model, disturbance_std: NDArray[np.float64], noise_std: NDArray[np.float64]) -> LinearObserver:
    """One-step predictor z+ = A z + [B E] (u, d_mean) + L (y - C z), r = y - C z the innovation.

    Args:
        model: the plant.
        disturbance_std: (m_d,) standard deviation of d about its mean, which is the last m_d known inputs.
        noise_std: (p,) standard deviation of the noise on y.
    """
    A, E, C = model.A, model.E, model.C
    Q, R = E @ np.diag(disturbance_std**2) @ E.T, np.diag(noise_std**2)
    P = solve_discrete_are(A.T, C.T, Q, R)
    L = np.asarray(np.linalg.solve(C @ P @ C.T + R, C @ P @ A.T).T)
    return predictor(A, np.hstack([model.B, E]), C, L)
