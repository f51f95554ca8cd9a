"""Exact decoupling: when the unknown inputs can be cancelled altogether, and the gain that does it.

Exact decoupling with delay delta exists iff rank Gamma_delta - rank Gamma_delta-1 = rank [B; D] (Sundaram and
Hadjicostis; theory section 7), and then L = Phi Gamma^+ + F N with N the left null space of Gamma and F free. The error
dynamics Q = A - L Theta can be made Schur iff the invariant zeros of (A, B, C, D) lie in the unit circle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_discrete_are

from monitor.acceptor import unobservable
from monitor.delayed.model import window_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.delayed.model import Model, Window

_RANK = 1e-9  # relative: singular values below it are zero
_SCHUR = 1.0 - 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Decoupling:
    """What exact decoupling takes and whether it is there.

    Attributes:
        gained_rank: rank Gamma_delta - rank Gamma_delta-1.
        needed_rank: rank [B; D].
        possible: gained_rank = needed_rank.
        L: a stable exactly decoupling gain (n, (delta + 1) p), None when there is none.
        radius: spectral radius with that gain, or of the zeros that no gain moves; None when it is not possible.
    """

    gained_rank: int
    needed_rank: int
    possible: bool
    L: NDArray[np.float64] | None
    radius: float | None

    @property
    def reason(self) -> str:
        """One line on what is missing, empty when nothing is."""
        if not self.possible:
            return f"rank Gamma_delta - rank Gamma_delta-1 is {self.gained_rank}, expected {self.needed_rank}"
        if self.L is None:
            return f"an invariant zero of modulus >= 1 keeps the radius at {self.radius:.4g}"
        return ""


def decouple(model: Model, window: Window) -> Decoupling:
    """Decide on exact decoupling and design it by a dual LQR (weights I, I) on (A - Phi Gamma^+ Theta, N Theta)."""
    left, values, right = np.linalg.svd(window.Gamma)
    rank = _count(values)
    before = _rank(window_of(model, window.delay - 1).Gamma) if window.delay else 0
    needed = model.B.shape[1]
    if rank - before < needed:
        return Decoupling(gained_rank=rank - before, needed_rank=needed, possible=False, L=None, radius=None)
    L0 = (window.Phi @ right[:rank].T / values[:rank]) @ left[:, :rank].T
    N = left[:, rank:].T
    fixed = _hidden_radius(model.A - L0 @ window.Theta, N @ window.Theta)
    if fixed >= _SCHUR:
        return Decoupling(gained_rank=rank - before, needed_rank=needed, possible=True, L=None, radius=fixed)
    L = np.asarray(L0 + _stabilise(model.A - L0 @ window.Theta, N @ window.Theta) @ N, dtype=np.float64)
    radius = float(np.max(np.abs(np.linalg.eigvals(model.A - L @ window.Theta))))
    return Decoupling(gained_rank=rank - before, needed_rank=needed, possible=True, L=L, radius=radius)


def _hidden_radius(A: NDArray[np.float64], C: NDArray[np.float64]) -> float:
    """Largest modulus of the modes that no F in A - F C moves: the invariant zeros of the plant."""
    hidden = unobservable(A, C)
    return float(np.max(np.abs(np.linalg.eigvals(hidden.T @ A @ hidden)), initial=0.0)) if hidden.size else 0.0


def _stabilise(A: NDArray[np.float64], C: NDArray[np.float64]) -> NDArray[np.float64]:
    """F (n, rows of C) of the dual LQR that makes A - F C Schur; its hidden modes are stable."""
    if not C.size or np.max(np.abs(C)) <= _RANK:
        return np.zeros((len(A), len(C)))
    left, values, right = np.linalg.svd(C, full_matrices=False)
    rank = _count(values)
    reduced = right[:rank]  # orthonormal combinations of the rows: the LQR does not depend on how N is scaled
    P = solve_discrete_are(A.T, reduced.T, np.eye(len(A)), np.eye(rank))
    gain = np.linalg.solve(np.eye(rank) + reduced @ P @ reduced.T, reduced @ P @ A.T).T
    return np.asarray((gain / values[:rank]) @ left[:, :rank].T, dtype=np.float64)


def _rank(matrix: NDArray[np.float64]) -> int:
    return _count(np.asarray(np.linalg.svd(matrix, compute_uv=False), dtype=np.float64))


def _count(values: NDArray[np.float64]) -> int:
    """Number of singular values that are not rounding."""
    return int(np.count_nonzero(values > _RANK * np.max(values, initial=_RANK)))
