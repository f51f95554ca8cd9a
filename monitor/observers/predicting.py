"""An observer whose residual is the one-step prediction error of y: for outputs whose y - C xhat shows nothing.

r_t+1 = F' N [u_t; y_t; xi_t; u_t+1; y_t+1] with N the rows of the left null space of the regressors that look at y_t+1,
F (f, p) their part on y_t+1, orthonormal, and xi the estimated states: no unknown input reaches it. The prediction is
kept beside the states, z = [z1; s].
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monitor.linear_observer import LinearObserver

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from monitor.acceptor import Acceptors
    from monitor.behaviour import Behaviour

_RANK = 1e-9  # relative: rounding in the null space


def predicting_observer(
    behaviour: Behaviour, acceptors: Acceptors, W: NDArray[np.float64], free: Sequence[int], fixed: Sequence[int]
) -> LinearObserver:
    """Integrate the states `free`; `fixed` follow from the outputs that no unknown input reaches directly.

    With y' = R y = C1 x1 + C2 x2 + R D u: xhat1 = z1 + D1 v, xhat2 = C2^+ (y' - R D u - C1 xhat1).
    """
    m, p, k = acceptors.regression.widths
    R = behaviour.undisturbed
    C = R @ behaviour.C
    W_p, A1, D1 = np.split(W, [m + p, m + p + k], axis=1)
    N, F = _predicting_rows(acceptors)
    N_p, N_1, N_f = np.split(N, [m + p, m + p + k], axis=1)
    f, n = len(N), C.shape[1]
    static = R @ np.hstack([-behaviour.D, np.eye(p)])  # y' - R D u from v = (u, y)
    inverse = np.linalg.pinv(C[:, fixed], rcond=_RANK) if fixed else np.zeros((0, len(C)))
    M, D = np.zeros((n, k + f)), np.zeros((n, m + p))
    M[free, :k], D[free] = np.eye(k), D1
    M[fixed, :k], D[fixed] = -inverse @ C[:, free], inverse @ (static - C[:, free] @ D1)
    guess = np.linalg.pinv(C, rcond=_RANK) @ static if len(C) else np.zeros((n, m + p))
    return LinearObserver(
        A=np.block([[A1, np.zeros((k, f))], [N_1, np.zeros((f, f))]]),
        B=np.vstack([W_p + A1 @ D1, N_p + N_1 @ D1]),
        M=M,
        D=D,
        H=np.hstack([np.zeros((p, k)), F.T]),
        J=F.T @ N_f,
        Z=np.vstack([guess[free] - D1, -N_f]),
        inputs=m,
        outputs=p,
    )


def _predicting_rows(acceptors: Acceptors) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rows N (f, s) of the left null space that look at y_t+1, scaled so that their part F (f, p) is orthonormal."""
    m, p, k = acceptors.regression.widths
    on_future = acceptors.N[:, m + p + k + m :]
    left, values, right = np.linalg.svd(on_future, full_matrices=False)
    count = int(np.count_nonzero(values > max(_RANK, acceptors.tolerance)))
    N = (left[:, :count] / values[:count]).T @ acceptors.N
    return N, right[:count]
