"""Model-based unknown-input observer (Chen, Patton and Zhang 1996; Darouach 1994) with its whole freedom."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_discrete_are

from monitor.errors import MonitorError
from monitor.linear_observer import LinearObserver

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.baselines.model import Model

_DECOUPLED = 1e-9  # largest |(I - H C) E| that counts as decoupling, relative to |E|


@dataclass(frozen=True, slots=True, kw_only=True)
class UioGains:
    """The freedom of a model-based UIO.

    Attributes:
        H: (n, p) with (I - H C) E = 0.
        K: (n, p) output injection.
    """

    H: NDArray[np.float64]
    K: NDArray[np.float64]


def decoupling_gains(model: Model, decay: float, Y: NDArray[np.float64] | None = None) -> UioGains:
    """Gains with H = E (CE)^+ + Y (I - CE (CE)^+) and every mode of A_UIO within the decay by a dual regulator.

    Raises:
        MonitorError: rank CE < rank E.
    """
    A, E, C = model.A, model.E, model.C
    CE = C @ E
    inverse = np.linalg.pinv(CE)
    free = np.zeros((len(A), len(C))) if Y is None else Y
    H = E @ inverse + free @ (np.eye(len(C)) - CE @ inverse)
    T = np.eye(len(A)) - H @ C
    if np.linalg.norm(T @ E) > _DECOUPLED * max(float(np.linalg.norm(E)), 1.0):
        raise MonitorError(
            "the model has rank CE < rank E, expected equality: no observer decouples the unknown inputs"
        )
    scaled, output = (T @ A).T / decay, C.T
    X = solve_discrete_are(scaled, output, np.eye(len(A)), np.eye(len(C)))
    K = decay * np.linalg.solve(np.eye(len(C)) + C @ X @ output, C @ X @ scaled).T
    return UioGains(H=H, K=np.asarray(K))


def model_based_uio(model: Model, gains: UioGains) -> LinearObserver:
    """With T = I - H C: z+ = A_UIO z + T B u + (K + A_UIO H) y, xhat = z + H y, A_UIO = T A - K C."""
    A, B, C, H, K = model.A, model.B, model.C, gains.H, gains.K
    n, m, p = len(A), B.shape[1], len(C)
    T = np.eye(n) - H @ C
    A_UIO = T @ A - K @ C
    D = np.hstack([np.zeros((n, m)), H])
    pick_y = np.hstack([np.zeros((p, m)), np.eye(p)])
    return LinearObserver(
        A=A_UIO,
        B=np.hstack([T @ B, K + A_UIO @ H]),
        M=np.eye(n),
        D=D,
        H=-C,
        J=pick_y - C @ D,
        Z=np.linalg.pinv(C) @ pick_y - D,
        inputs=m,
        outputs=p,
    )
