"""The gain of guaranteed performance when exact decoupling is impossible: C's LMI, line search on a (theory section 7).

For fixed a in (0, 1) find P > 0, Y = P L and mu >= 0 with
[(1-a) P, 0, (P A - Y Theta)'; 0, a I, (Y Gamma - P Phi)'; *, *, P] >= 0 and [P, H'; H, mu I] >= 0, mu minimal.
Then e' P e <= sup |W|^2 in the limit, so limsup |H e| <= sqrt(mu) sup |W_k:k+delta| <= sqrt(mu (delta + 1)) sup |w|.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any
from warnings import catch_warnings, simplefilter

import numpy as np

from monitor.delayed.model import window_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.delayed.model import Model, Window

_GRID = (0.1, 0.3, 0.5, 0.7, 0.9)
_STEP = 0.2  # of the grid
_SMALLEST = 0.01
_LARGEST = 0.99  # a -> 1 asks for a deadbeat error, where P grows without bound
_REFINEMENTS = 7  # golden-section steps: a to about 0.01, where mu is flat
_RANK = 1e-9  # relative: a state that is pushed less is not pushed
_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Performance:
    """Solution of the LMI.

    Attributes:
        L: (n, (delta + 1) p).
        mu: minimal mu at the best a, as the solver reports it.
        a: where the line search ended.
    """

    L: NDArray[np.float64]
    mu: float
    a: float


def optimise(model: Model, window: Window, H: NDArray[np.float64]) -> Performance | None:
    """Search a for the smallest mu; None when the LMI is infeasible everywhere: the plant is not detectable."""
    problem = _Problem(model, window, H)
    found = [one for one in (problem.solve(a) for a in _GRID) if one is not None]
    if not found:
        return None
    best = min(found, key=lambda one: one.mu)
    low, high = max(best.a - _STEP, _SMALLEST), min(best.a + _STEP, _LARGEST)
    probes = [high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)]
    tried = [problem.solve(a) for a in probes]
    for _ in range(_REFINEMENTS):
        best = min([best, *(one for one in tried if one)], key=lambda one: one.mu)
        left, right = (np.inf if one is None else one.mu for one in tried)
        if left <= right:
            high, probes = probes[1], [probes[1] - _GOLDEN * (probes[1] - low), probes[0]]
            tried = [problem.solve(probes[0]), tried[0]]
        else:
            low, probes = probes[0], [probes[1], probes[0] + _GOLDEN * (high - probes[0])]
            tried = [tried[1], problem.solve(probes[1])]
    return best


def solve_lmi(model: Model, window: Window, H: NDArray[np.float64], a: float) -> Performance | None:
    """Solve the LMI for one a; None when it is infeasible there."""
    return _Problem(model, window, H).solve(a)


class _Problem:
    """The LMI compiled once, with a as a parameter."""

    def __init__(self, model: Model, window: Window, H: NDArray[np.float64]) -> None:
        """Build the constraints."""
        cp: Any = import_module("cvxpy")  # takes a second, which nodes that solve no LMI must not pay
        scale, size = _reached(model, window.delay), float(np.linalg.norm(H, 2))
        self._scale, self._size = scale, size
        model, H = _scaled(model, scale), H * scale / size
        window = window_of(model, window.delay)
        n, q = len(model.A), window.Gamma.shape[1]
        self._cp = cp
        self._a = cp.Parameter(nonneg=True)
        self._P = cp.Variable((n, n), symmetric=True)
        self._Y = cp.Variable((n, len(window.Theta)))
        self._mu = cp.Variable()
        moved = self._P @ model.A - self._Y @ window.Theta
        pushed = self._Y @ window.Gamma - self._P @ window.Phi
        zero = np.zeros((n, q))
        invariant = cp.bmat(
            [
                [(1.0 - self._a) * self._P, zero, moved.T],
                [zero.T, self._a * np.eye(q), pushed.T],
                [moved, pushed, self._P],
            ]
        )
        seen = cp.bmat([[self._P, H.T], [H, self._mu * np.eye(len(H))]])
        self._problem = cp.Problem(cp.Minimize(self._mu), [invariant >> 0, seen >> 0])

    def solve(self, a: float) -> Performance | None:
        """Solve for one a; None when the solver finds no point."""
        self._a.value = a
        with catch_warnings():
            simplefilter("ignore")  # what the gain is worth is measured afterwards, not read from the status
            try:
                self._problem.solve(solver=self._cp.CLARABEL)
            except self._cp.SolverError:
                return None
        if self._problem.status not in {self._cp.OPTIMAL, self._cp.OPTIMAL_INACCURATE}:
            return None
        try:
            L = np.linalg.solve(self._P.value, self._Y.value)
        except np.linalg.LinAlgError:
            return None
        mu = self._size**2 * float(max(self._mu.value, 0.0))
        return Performance(L=np.asarray(self._scale[:, None] * L, dtype=np.float64), mu=mu, a=a)


def _reached(model: Model, delay: int) -> NDArray[np.float64]:
    """How far unknown inputs of norm 1 push every state within the window: the solver needs states of like size."""
    pushed, power = [], model.B
    for _ in range(len(model.A) + delay):
        pushed.append(power)
        power = model.A @ power
    size = np.linalg.norm(np.hstack(pushed), axis=1)
    return np.where(size > _RANK * np.max(size, initial=_RANK), size, 1.0)


def _scaled(model: Model, scale: NDArray[np.float64]) -> Model:
    """Model of x / scale."""
    return replace(
        model,
        A=model.A * scale / scale[:, None],
        B=model.B / scale[:, None],
        C=model.C * scale,
        B_u=model.B_u / scale[:, None],
    )
