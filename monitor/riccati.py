"""The filter of least error, by doubling and Newton: never an exception, and the same to rounding on every machine.

For e+ = (A - L C) e + (W - L V) v with white v of unit covariance, the gain of least X = E e e' (in every direction at
once) solves the discrete Riccati equation

X = A X A' + W W' - L (C X C' + V V') L',  L = (A X C' + W V') (C X C' + V V')^-1.

Structure-preserving doubling (Chu, Fan, Lin and Wang, Int. J. Control 77, 2004) inverts only matrices I + G H with
G, H >= 0 and goes on where the ordered Schur form that a library takes gives up, up to modes on the unit circle.
Newton's method (Hewer 1971: the error of the present gain, then the best gain for it) converges quadratically from
there; what it ends with owes nothing to where it began.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monitor.sight import accumulated

if TYPE_CHECKING:
    from numpy.typing import NDArray

_DOUBLINGS = 60
_NEWTON = 20
_CONVERGED = 1e-15  # relative
_STABLE = 1.0 - 1e-9


def filter_gain(
    A: NDArray[np.float64], C: NDArray[np.float64], W: NDArray[np.float64], V: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """L (n, p) of least error; None when doubling finds no stable one: a mode that C does not show is unstable.

    Args:
        A: (n, n).
        C: (p, n).
        W: (n, q), how v drives the error; every mode on or outside the unit circle should be driven.
        V: (p, q) of full row rank, well conditioned in the units at hand.
    """
    L = _best(A, C, W, V, _doubled(A, C, W, V))
    if L is None or not _stable(A - L @ C):
        return None
    change = np.inf
    for _ in range(_NEWTON):
        pushed = W - L @ V
        with np.errstate(over="ignore", invalid="ignore"):
            X = accumulated(A - L @ C, pushed @ pushed.T)
        better = _best(A, C, W, V, X)
        if better is None or not _stable(A - better @ C):
            break
        before, change = change, float(np.linalg.norm(better - L))
        if change >= before:
            break
        L = better
        if change <= _CONVERGED * np.linalg.norm(L):
            break
    return L


def dual_lqr(A: NDArray[np.float64], C: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """L (n, p) that makes A - L C Schur: the dual regulator with unit weights; None when (A, C) is not detectable."""
    n, p = len(A), len(C)
    return filter_gain(A, C, np.eye(n, n + p), np.eye(p, n + p, k=n))


def _best(
    A: NDArray[np.float64],
    C: NDArray[np.float64],
    W: NDArray[np.float64],
    V: NDArray[np.float64],
    X: NDArray[np.float64],
) -> NDArray[np.float64] | None:
    """Best gain when the error is X; None when X is out of range."""
    if not np.isfinite(X).all():
        return None
    S = C @ X @ C.T + V @ V.T
    try:
        return np.asarray(np.linalg.solve(S, C @ X @ A.T + V @ W.T).T)
    except np.linalg.LinAlgError:
        return None


def _doubled(
    A: NDArray[np.float64], C: NDArray[np.float64], W: NDArray[np.float64], V: NDArray[np.float64]
) -> NDArray[np.float64]:
    """X by doubling, in the form without correlation: what V tells of v is taken out of A and W first."""
    inverse = np.linalg.pinv(V)  # V' (V V')^-1
    known = inverse @ V
    rest = W - W @ known
    whitened = inverse.T @ inverse  # (V V')^-1
    power, G, X = (A - W @ inverse @ C).T, C.T @ whitened @ C, rest @ rest.T
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(_DOUBLINGS):
            try:
                moved = np.linalg.solve(np.eye(len(A)) + G @ X, np.hstack([power, G]))
            except np.linalg.LinAlgError:
                return np.full_like(X, np.nan)
            forward, spread = np.split(moved, 2, axis=1)
            added = power.T @ X @ forward
            G, X, power = G + power @ spread @ power.T, X + added, power @ forward
            G, X = (G + G.T) / 2.0, (X + X.T) / 2.0
            if not np.linalg.norm(added) > _CONVERGED * np.linalg.norm(X):
                break
    return X


def _stable(A: NDArray[np.float64]) -> bool:
    return bool(np.isfinite(A).all() and np.max(np.abs(np.linalg.eigvals(A)), initial=0.0) < _STABLE)
