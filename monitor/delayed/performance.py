"""The gain of guaranteed performance when exact decoupling is impossible: C's LMI, line search on a (theory section 7).

For fixed a in (0, 1) find P > 0, Y = P L and mu >= 0 with
[(1-a) P, 0, (P A - Y Theta)'; 0, a I, (Y Gamma - P Phi)'; *, *, P] >= 0 and [P, H'; H, mu I] >= 0, mu minimal.
Then e' P e <= sup |W|^2 in the limit, so limsup |H e| <= sqrt(mu) sup |W_k:k+delta| <= sqrt(mu (delta + 1)) sup |w|.

No semidefinite programme is needed (ours). By Schur complements the first inequality reads, with X = P^-1,
X >= (A - L Theta) X (A - L Theta)' / (1 - a) + (L Gamma - Phi) (L Gamma - Phi)' / a,
and the gain of the filter for x+ = A x / sqrt(1 - a) + Phi v / sqrt(a), y = Theta x / sqrt(1 - a) + Gamma v / sqrt(a)
has the smallest such X of all gains, in every direction at once: it minimises mu = lambda_max(H X H') whatever H is.
A Riccati equation is solved to rounding, where an interior-point method ends somewhere near its optimum, and elsewhere
on another processor. tests/monitor/delayed holds it against the programme.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from monitor.delayed.model import window_of
from monitor.riccati import filter_gain
from monitor.sight import accumulated

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.delayed.model import Model, Window

_GRID = range(50, 1000, 100)  # thousandths of a
_SMALLEST, _LARGEST = 10, 990  # a -> 1 asks for a deadbeat error
_RANK = 1e-9  # relative: a state that is pushed less is not pushed
_NOISE = 1e-3  # on states and outputs, of what unknown inputs do there: keeps the equation well posed


@dataclass(frozen=True, slots=True, kw_only=True)
class Performance:
    """Solution of the LMI.

    Attributes:
        L: (n, (delta + 1) p).
        mu: minimal mu at this a.
        a: where the line search ended, in whole thousandths: mu is flat there, and every machine ends at the same.
    """

    L: NDArray[np.float64]
    mu: float
    a: float


def optimise(model: Model, window: Window, H: NDArray[np.float64]) -> Performance | None:
    """Search a for the smallest mu; None when the LMI is infeasible everywhere: the plant is not detectable."""
    tried: dict[int, Performance | None] = {}

    def at(thousandths: int) -> float:
        if thousandths not in tried:
            tried[thousandths] = solve_lmi(model, window, H, thousandths / 1000.0)
        found = tried[thousandths]
        return np.inf if found is None else found.mu

    best = min(_GRID, key=at)
    step = _GRID.step
    while step > 1:
        step = max(step // 3, 1)
        near = (best, best - step, best - 2 * step, best + step, best + 2 * step)
        best = min((one for one in near if _SMALLEST <= one <= _LARGEST), key=at)
    return tried[best]


def solve_lmi(model: Model, window: Window, H: NDArray[np.float64], a: float) -> Performance | None:
    """Solve the LMI for one a; None when it is infeasible there."""
    scale = _reached(model, window.delay)
    scaled = _scaled(model, scale)
    sizes = np.linalg.norm(np.hstack([scaled.C, scaled.D]), axis=1)
    outputs = np.tile(np.where(sizes > 0.0, sizes, 1.0), window.delay + 1)[:, None]
    inner = window_of(scaled, window.delay)
    n, rows, kept, pushed = len(scale), len(outputs), np.sqrt(1.0 - a), np.sqrt(a)
    W = np.hstack([inner.Phi / pushed, _NOISE * np.eye(n), np.zeros((n, rows))])
    V = np.hstack([inner.Gamma / outputs / pushed, np.zeros((rows, n)), _NOISE * np.eye(rows)])
    gain = filter_gain(scaled.A / kept, inner.Theta / outputs / kept, W, V)
    if gain is None:
        return None
    L = np.asarray(scale[:, None] * gain / outputs.T)
    X = scale[:, None] * _spread(scaled, inner, gain / outputs.T, a) * scale
    return Performance(L=L, mu=float(max(np.linalg.eigvalsh(H @ X @ H.T)[-1], 0.0)), a=a)


def _spread(model: Model, window: Window, L: NDArray[np.float64], a: float) -> NDArray[np.float64]:
    """X = Q X Q' / (1 - a) + N N' / a, the smallest X that the LMI allows for this gain."""
    Q, N = model.A - L @ window.Theta, L @ window.Gamma - window.Phi
    return accumulated(Q / np.sqrt(1.0 - a), N @ N.T / a)


def _reached(model: Model, delay: int) -> NDArray[np.float64]:
    """How far unknown inputs of norm 1 push every state within the window: the filter needs states of like size."""
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
