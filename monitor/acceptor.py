"""All observers that reproduce every trajectory in the data: W S = X_f with W = W0 + Q N.

T (13)-(14) for the full order, reduced-order UIO paper (14)-(19) for the reduced order, parametrised after Disaro and
Valcher (arXiv 2311.00673). One path for both: they differ in which states the target holds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monitor.kernel import null_space

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.behaviour import Behaviour


_HIDDEN = 1e-9  # relative: a direction that leaves the kernel by less is hidden


@dataclass(frozen=True, slots=True, kw_only=True)
class Regression:
    """Regressors and target on the basis of the behaviour.

    Attributes:
        S: (m + p + k + m + p, r) rows [U_p; Y_p; Xi_p; U_f; Y_f], Xi the k estimated states.
        target: (k, r) Xi_f.
        widths: (m, p, k), the block heights.
    """

    S: NDArray[np.float64]
    target: NDArray[np.float64]
    widths: tuple[int, int, int]

    @property
    def state_columns(self) -> slice:
        """Columns of W that multiply the estimate."""
        m, p, k = self.widths
        return slice(m + p, m + p + k)


@dataclass(frozen=True, slots=True, kw_only=True)
class Acceptors:
    """All solutions W = W0 + Q N of W S = target.

    Attributes:
        regression: what is solved.
        W0: (k, s) the solution of least norm.
        N: (f, s) orthonormal rows that span the left null space of S; Q (k, f) is free.
        rank: of S.
        margin: smallest singular value of S relative to its largest on the target's behaviour; the kernel condition
            ker S in ker target holds exactly when it is not zero.
        tolerance: relative, directions of S below it carry only rounding or noise.
    """

    regression: Regression
    W0: NDArray[np.float64]
    N: NDArray[np.float64]
    rank: int
    margin: float
    tolerance: float

    @property
    def W_x0(self) -> NDArray[np.float64]:  # noqa: N802 - the symbol of the paper
        """(k, k) block of W0 that multiplies the estimate: A_UIO for Q = 0."""
        return self.W0[:, self.regression.state_columns]

    @property
    def N_x(self) -> NDArray[np.float64]:  # noqa: N802 - the symbol of the paper
        """(f, k) block of N that multiplies the estimate."""
        return self.N[:, self.regression.state_columns]


def regress(behaviour: Behaviour, selection: NDArray[np.float64]) -> Regression:
    """Set up the equation for the states `selection @ x`, selection (k, n)."""
    m, p, k = len(behaviour.L_u), len(behaviour.C), len(selection)
    S = np.vstack([behaviour.L_u, behaviour.L_y, selection @ behaviour.L_x, behaviour.L_uf, behaviour.L_yf])
    return Regression(S=S, target=selection @ behaviour.L_xf, widths=(m, p, k))


def solve(regression: Regression, tolerance: float) -> Acceptors | None:
    """Solve W S = target for all W, or return None when ker S is not in ker target: T (13) fails.

    A direction of S below the tolerance, relative to its largest singular value, carries only rounding or noise.
    """
    values, right = np.linalg.svd(regression.S, full_matrices=True)[1:]
    rank = int(np.count_nonzero(values > tolerance * values[0]))
    if _unseen_motion(regression, right[rank:].T) > tolerance * values[0]:
        return None
    return solve_of_rank(regression, rank, tolerance)


def unseen_motion(regression: Regression, tolerance: float) -> tuple[float, float]:
    """Where T (13) fails: how far a trajectory of size 1 that leaves hardly a trace moves the state, and that trace."""
    values, right = np.linalg.svd(regression.S, full_matrices=True)[1:]
    rank = int(np.count_nonzero(values > tolerance * values[0]))
    trace = float(values[rank]) if rank < len(values) else 0.0
    return _unseen_motion(regression, right[rank:].T), trace


def _unseen_motion(regression: Regression, kernel: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(regression.target @ kernel, 2)) if kernel.size else 0.0


def solve_of_rank(regression: Regression, rank: int, tolerance: float) -> Acceptors:
    """Solve W S = target for all W where the rank of S is decided and ker S is in ker target."""
    left, values, right = np.linalg.svd(regression.S, full_matrices=True)
    W0 = (regression.target @ right[:rank].T / values[:rank]) @ left[:, :rank].T
    margin = float(values[rank - 1] / values[0])
    N = left[:, rank:].T
    return Acceptors(regression=regression, W0=W0, N=N, rank=rank, margin=margin, tolerance=tolerance)


def fixed_modes(acceptors: Acceptors) -> NDArray[np.complex128]:
    """Eigenvalues of W_x0 + Q N_x that no Q moves: the invariant zeros of (A, E, C, G) among them."""
    A, C = acceptors.W_x0, acceptors.N_x
    hidden = unobservable(A, C)
    modes = np.linalg.eigvals(hidden.T @ A @ hidden) if hidden.shape[1] else np.zeros(0)
    return modes.astype(np.complex128)


def unobservable(A: NDArray[np.float64], C: NDArray[np.float64], tolerance: float = _HIDDEN) -> NDArray[np.float64]:
    """Orthonormal basis of the unobservable subspace of (A, C), by shrinking ker C to its largest A-invariant part.

    Args:
        A: (n, n).
        C: (p, n).
        tolerance: how wrong A and (relative) C may be: what is seen by less is not seen.
    """
    basis: NDArray[np.float64] = null_space(C, rcond=tolerance) if len(C) else np.eye(len(A))
    while basis.shape[1]:
        leaving = A @ basis - basis @ (basis.T @ A @ basis)
        size = float(np.linalg.norm(leaving, 2))
        # rounding grows from round to round: what leaves by less than the tolerance does not leave
        kept = null_space(leaving, rcond=tolerance / size) if size > tolerance else np.eye(basis.shape[1])
        if kept.shape[1] == basis.shape[1]:
            return basis
        basis = basis @ kept
    return basis
