"""Choosing the poles of op-UIE within all solutions [U1 Y1] = W0 + K N (I, section III-A; theory section 6).

A_op = A_u + B_u K C_u with C_u = N_z, the part of the left null space N of H that multiplies z, B_u = [0; I]. With
W > 0, M and X such that M C_u = C_u W and [rho^2 W, (A_u W + B_u X C_u)'; *, W] > 0, K = X M^-1 makes the spectral
radius smaller than rho. The paper's F has U_f V F = -K T1' there; only the product matters.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING
from warnings import catch_warnings, simplefilter

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_BISECTIONS = 7  # brings the decay within 1 % of the best the LMI can certify
_DEPENDENT = 1e-9  # relative: rows of N_z below it are dependent
_DIGITS = 4  # behind the first
_MARGIN = 1e-3  # the search starts this far above the largest zero


@dataclass(frozen=True, slots=True, kw_only=True)
class Solutions:
    """All [U1 Y1] that reconstruct the input on every trajectory.

    Attributes:
        W0: (m, past m + L p) solution of least norm.
        N: (f, past m + L p) orthonormal rows spanning the left null space of H.
        past_inputs: past m, how many leading columns multiply z.
    """

    W0: NDArray[np.float64]
    N: NDArray[np.float64]
    past_inputs: int

    def A_op(self, W: NDArray[np.float64]) -> NDArray[np.float64]:  # noqa: N802 - the symbol of the paper
        """A_op = [shift; U1] of one solution."""
        A_op = np.eye(self.past_inputs, k=len(W))
        A_op[-len(W) :] = W[:, : self.past_inputs]
        return A_op


def place(solutions: Solutions, fastest: float) -> NDArray[np.float64] | None:
    """Solution of the smallest spectral radius that the LMI finds, or None when it finds no stable one.

    Args:
        solutions: what to choose from.
        fastest: modulus of the largest invariant zero, below which no radius can be.
    """
    best, radius = None, 1.0
    low, high = fastest, 1.0
    for attempt in range(_BISECTIONS + 1):
        decay = high if attempt == 0 else min(high, (low + high) / 2.0 + _MARGIN * (high - low))
        found = _solve(solutions, decay)
        reached = np.inf if found is None else _radius(solutions, found)
        if reached < radius:
            best, radius = found, reached
        # in whole steps, so that the next programme is the same wherever this one ended within its tolerance
        low, high = (low, min(high, np.ceil(reached / _MARGIN) * _MARGIN)) if reached <= decay else (decay, high)
        if attempt == 0 and best is None:
            return None
        if high - low < _MARGIN:
            break
    return None if best is None else _rounded(solutions, best, radius)


def _rounded(solutions: Solutions, W: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
    """What is added to W0 in the digits that the solver can promise; the whole where that costs the radius."""
    added = W - solutions.W0
    step = 10.0 ** (np.floor(np.log10(max(float(np.max(np.abs(added))), _MARGIN))) - _DIGITS)
    rounded = np.round(added / step) * step
    found = np.asarray(solutions.W0 + rounded @ solutions.N.T @ solutions.N)  # reconstructs on every trajectory still
    return found if _radius(solutions, found) <= radius + _MARGIN / 2.0 and radius + _MARGIN / 2.0 < 1.0 else W


def _radius(solutions: Solutions, W: NDArray[np.float64]) -> float:
    return float(np.max(np.abs(np.linalg.eigvals(solutions.A_op(W)))))


def _solve(solutions: Solutions, decay: float) -> NDArray[np.float64] | None:
    """One feasibility problem; None when the solver finds no point."""
    cp = import_module("cvxpy")  # takes a second, which nodes that never place poles must not pay
    m, n = len(solutions.W0), solutions.past_inputs
    A_u = solutions.A_op(solutions.W0)
    reduce, C_u = _independent(solutions.N[:, :n])
    if not len(C_u):
        return None
    W = cp.Variable((n, n), symmetric=True)
    M = cp.Variable((len(C_u), len(C_u)))
    X = cp.Variable((m, len(C_u)))
    moved = A_u @ W + np.eye(n)[:, n - m :] @ (X @ C_u)
    decreases = cp.bmat([[decay**2 * W, moved.T], [moved, W]])
    problem = cp.Problem(cp.Minimize(cp.trace(W)), [M @ C_u == C_u @ W, decreases >> 0, np.eye(n) << W])
    with catch_warnings():
        simplefilter("ignore")  # a solution called inaccurate is judged by the spectral radius it reaches
        try:
            problem.solve(solver=cp.CLARABEL)
        except (cp.SolverError, ValueError, ArithmeticError):
            return None
    if M.value is None or X.value is None or problem.status not in {cp.OPTIMAL, cp.OPTIMAL_INACCURATE}:
        return None
    K = np.linalg.lstsq(M.value.T, X.value.T, rcond=None)[0].T @ reduce
    return np.asarray(solutions.W0 + K @ solutions.N)


def _independent(N_z: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Orthonormal combinations R of the rows of N_z that are independent, and R N_z (the paper's elimination T2)."""
    left, values, _ = np.linalg.svd(N_z, full_matrices=False)
    kept = values > _DEPENDENT * np.max(values, initial=_DEPENDENT)
    reduce = left[:, kept].T
    return reduce, reduce @ N_z
