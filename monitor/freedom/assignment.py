"""Moving the eigenvalues of A_UIO = W_x0 + Q N_x: dual LQR and pole placement."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monitor.acceptor import unobservable
from monitor.freedom.problem import Refusal
from monitor.riccati import dual_lqr as regulator

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.acceptor import Acceptors
    from monitor.freedom.problem import FreedomOptions, Problem

_DEFAULT_DECAY = 0.5
_RANK = 1e-9  # relative: a row of N_x below is rounding
_PLACED = 5e-5  # poles this far from where they should be are not placed
_EQUAL = 1e-9  # relative: a mode at the decay itself is within it
_TIES = 6  # digits
_CANDIDATES = 60  # choices of eigenvectors that are compared
_MOVED = 0.1  # size of the gain that moves eigenvalues away from where poles shall be
_APART = 1e-6  # relative: a pole nearer to an eigenvalue counts as there already
_ILL = 1e10  # condition of the eigenvectors from which on poles are not placed but lost
_SPREAD = 0.2  # default poles lie in the upper fifth below the decay: distinct, as pole placement needs them


def dual_lqr(problem: Problem, options: FreedomOptions) -> NDArray[np.float64] | Refusal:
    """Steer e+ = (W_x0 + Q N_x) e by a linear-quadratic regulator of the dual system, so that every mode <= decay.

    On the modes that N_x moves, A = W_x0 / decay and C = N_x: the dual regulator of weights I, I gives A - L C Schur;
    Q = -decay L.
    """
    decay = _DEFAULT_DECAY if options.decay is None else options.decay
    acceptors = problem.acceptors
    refusal = _unreachable(acceptors, decay)
    if refusal is not None:
        return refusal
    A, N_x, seen, mixing = _movable(acceptors)
    L = regulator(A / decay, N_x)
    if L is None:
        return Refusal(
            f"dual_lqr: a decay of {decay:g} is out of reach of double precision here, a mode is hardly seen: "
            "ask for a decay nearer 1"
        )
    return acceptors.W0 - decay * seen @ L @ mixing @ acceptors.N


def pole_placement(problem: Problem, options: FreedomOptions) -> NDArray[np.float64] | Refusal:
    """Put every movable eigenvalue of A_UIO where it is asked for; the others are invariant zeros of (A, E, C)."""
    acceptors = problem.acceptors
    decay = _DEFAULT_DECAY if options.decay is None else options.decay
    if options.poles is None:
        refusal = _unreachable(acceptors, decay)
        if refusal is not None:
            return refusal
    movable = len(acceptors.W_x0) - unobservable(acceptors.W_x0, acceptors.N_x).shape[1]
    poles = default_poles(movable, decay) if options.poles is None else np.array(options.poles)
    if len(poles) != movable:
        return Refusal(f"{len(poles)} poles are given, expected {movable}: that many eigenvalues of A_UIO can be moved")
    Q = assign(acceptors, poles)
    if Q is None:
        return Refusal(
            "pole_placement: the eigenvalues cannot be placed accurately here (a mode is hardly seen, or poles coincide"
            " too often); ask for other poles, or use dual_lqr"
        )
    return acceptors.W0 + Q @ acceptors.N


def default_poles(count: int, decay: float) -> NDArray[np.float64]:
    """Distinct real poles just below the decay."""
    return decay * (1.0 - _SPREAD * np.arange(count) / max(count, 1))


def assign(acceptors: Acceptors, poles: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Q (k, f) that puts the movable eigenvalues of W_x0 + Q N_x at `poles`; None when rounding keeps them away."""
    A, N_x, seen, mixing = _movable(acceptors)
    if not len(A):
        return np.zeros((len(acceptors.W0), len(acceptors.N)))
    if len(N_x) == len(A):  # every entry of what can be moved is free
        return np.asarray(seen @ (np.diag(poles) - A) @ np.linalg.inv(N_x) @ mixing)
    inverse = np.linalg.pinv(N_x)
    rows = canonical_basis(inverse @ N_x, len(N_x)).T
    L, mixing = _placed(A, rows, poles), rows @ inverse @ mixing
    if L is None:
        return None
    distance = np.abs(np.linalg.eigvals(A - L @ rows)[:, None] - poles)
    if np.max(distance.min(axis=0)) > _PLACED or np.max(distance.min(axis=1)) > _PLACED:
        return None
    return np.asarray(-seen @ L @ mixing)


def _placed(A: NDArray[np.float64], C: NDArray[np.float64], poles: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """L (s, r) with eigenvalues of A - L C at the poles, from left eigenvectors that lie well apart.

    x_i = (A' - p_i I)^-1 C' g_i is a left eigenvector of A - L C with L' = G X^-1 (Bhattacharyya and de Souza, 1982).
    Of a fixed set of G the one with the best conditioned X is taken: nothing is iterated, so that rounding of A and C
    stays rounding, whatever processor it comes from.
    """
    s, r = len(A), len(C)
    draws = np.random.default_rng(0).standard_normal((_CANDIDATES + 1, r, s))
    for first in (np.zeros((s, r)), _MOVED * draws[-1].T):  # moved a little where a pole is an eigenvalue of A already
        moved = (A - first @ C).T
        shifted = moved - poles[:, None, None] * np.eye(s)
        if np.min(np.linalg.svd(shifted, compute_uv=False)) > _APART * max(1.0, float(np.linalg.norm(A, 2))):
            break
    else:
        return None
    reached = np.linalg.solve(shifted, np.broadcast_to(C.T, (s, s, r)))  # (s, s, r): pole, state, row
    X = np.einsum("ijk,cki->cji", reached, draws[:-1])
    sizes = np.linalg.norm(X, axis=1)
    if not np.min(sizes) > 0.0:
        return None
    X, G = X / sizes[:, None, :], draws[:-1] / sizes[:, None, :]
    conditions = np.linalg.cond(X)
    best = int(np.argmin(conditions))
    if not conditions[best] < _ILL:
        return None
    return np.asarray(first + np.linalg.solve(X[best].T, G[best].T))


def _movable(
    acceptors: Acceptors,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """What Q can move: A (s, s) and N_x (r, s) on the basis `seen` (k, s), and `mixing` (r, f) of these rows."""
    mixing, N_x = _row_basis(acceptors.N_x)
    hidden = unobservable(acceptors.W_x0, acceptors.N_x)
    seen = canonical_basis(np.eye(len(hidden)) - hidden @ hidden.T, len(hidden) - hidden.shape[1])
    return seen.T @ acceptors.W_x0 @ seen, N_x @ seen, seen, mixing


def canonical_basis(projector: NDArray[np.float64], rank: int) -> NDArray[np.float64]:
    """Orthonormal basis (k, rank) of the range of an orthogonal projector that owes nothing to how it came about.

    What a decomposition returns for a subspace depends on processor, units and order of signals; its projector does
    not. Columns are taken by size, ties within rounding by position.
    """
    rest, basis = projector.copy(), np.zeros((len(projector), 0))
    for _ in range(rank):
        sizes = np.linalg.norm(rest, axis=0)
        column = rest[:, int(np.argmax(np.round(sizes, _TIES)))]
        column = column - basis @ (basis.T @ column)
        basis = np.column_stack([basis, column / np.linalg.norm(column)])
        rest = projector - basis @ (basis.T @ projector)
    return basis


def _row_basis(N_x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Independent combinations: mixing (r, f) with orthonormal rows and mixing @ N_x (r, k) of full row rank."""
    left, values, _ = np.linalg.svd(N_x, full_matrices=False)
    rank = int(np.count_nonzero(values > _RANK)) if values.size else 0
    mixing = left[:, :rank].T
    return mixing, mixing @ N_x


def _unreachable(acceptors: Acceptors, decay: float) -> Refusal | None:
    """Say which eigenvalues keep A_UIO from the requested decay."""
    hidden = unobservable(acceptors.W_x0, acceptors.N_x)
    if not hidden.shape[1]:
        return None
    modes = np.linalg.eigvals(hidden.T @ acceptors.W_x0 @ hidden)
    slow = modes[np.abs(modes) > decay * (1.0 + _EQUAL)]
    if not len(slow):
        return None
    listed = ", ".join(f"{mode:.4g}" for mode in slow)
    return Refusal(f"a decay of {decay:g} cannot be reached: A_UIO keeps the eigenvalues {listed} whatever Q is")
