"""Unknown-input observer of reduced order, for outputs that show only part of the state.

Reduced-order UIO paper, (4) and (14)-(19): only the states x1 that y does not fix are integrated. Its y - C xhat is
zero by construction, so the residual is the one-step prediction error of y in the directions that no unknown input
reaches: r_t+1 = F' N [u_t; y_t; xhat1_t; u_t+1; y_t+1] with N the rows of the left null space of G that look at y_t+1
and F (f, p) their part on y_t+1, orthonormal. There are f = p - m_d of them: with p = m_d such an observer is blind.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import qr

from monitor.observers.designing import DesignOptions, Shape, design_uio
from monitor.observers.linear_observer import LinearObserver
from monitor.options import parse_options

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from monitor.acceptor import Acceptors
    from monitor.behaviour import Behaviour
    from monitor.history import History
    from monitor.observers.protocol import Design

KIND = "reduced_order"
_RANK = 1e-9  # relative: rounding in C and in the null space
_CONDITION = 1e6  # the last columns of C serve as C2 unless they are worse conditioned than this


def design(history: History, options: Mapping[str, object]) -> Design:
    """Design z+ = A z + B_u u + B_y y, xhat1 = z + D y, xhat2 = C2^+ (y - C1 xhat1)."""
    return design_uio(history, parse_options(DesignOptions, options, KIND), _SHAPE)


def split_states(C: NDArray[np.float64]) -> tuple[list[int], list[int]]:
    """States x1 to integrate and states x2 that y fixes once x1 is known: y = C1 x1 + C2 x2, C2 of full column rank.

    The paper's order (C2 the last columns) is kept where that C2 is well conditioned; else columns are permuted.
    """
    n = C.shape[1]
    rank = int(np.linalg.matrix_rank(C, tol=_RANK * float(np.linalg.norm(C, 2))))
    last = C[:, n - rank :]
    if np.linalg.cond(last) < _CONDITION:
        fixed = list(range(n - rank, n))
    else:
        fixed = sorted(int(column) for column in qr(C, pivoting=True)[2][:rank])
    return [state for state in range(n) if state not in fixed], fixed


def _selection(behaviour: Behaviour) -> NDArray[np.float64]:
    """Rows that pick x1."""
    free, _ = split_states(behaviour.C)
    return np.eye(behaviour.C.shape[1])[free]


def _observer(behaviour: Behaviour, acceptors: Acceptors, W: NDArray[np.float64]) -> LinearObserver:
    """(16)-(19) with the prediction error's memory s appended to the state: z = [z1; s]."""
    m, p, k = acceptors.regression.widths
    C = behaviour.C
    free, fixed = split_states(C)
    W_p, A1, D1 = np.split(W, [m + p, m + p + k], axis=1)
    N, F = _predicting_rows(acceptors)
    N_p, N_1, N_f = np.split(N, [m + p, m + p + k], axis=1)
    f = len(N)
    inverse = np.linalg.pinv(C[:, fixed])
    pick_y = np.hstack([np.zeros((p, m)), np.eye(p)])
    M, D = np.zeros((C.shape[1], k + f)), np.zeros((C.shape[1], m + p))
    M[free, :k], D[free] = np.eye(k), D1
    M[fixed, :k], D[fixed] = -inverse @ C[:, free], inverse @ (pick_y - C[:, free] @ D1)
    guess = np.linalg.pinv(C) @ pick_y
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
    count = int(np.count_nonzero(values > _RANK))
    N = (left[:, :count] / values[:count]).T @ acceptors.N
    return N, right[:count]


_SHAPE = Shape(kind=KIND, selection=_selection, observer=_observer)
