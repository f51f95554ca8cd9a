"""What the data of one node say: conditions (18), (19) and the construction (20) with a T_y of the right rank."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monitor.acceptor import unobservable

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.distributed.regressors import Regressors

_SPARE = 2  # columns beyond those that anything fits
_EXACT = 1e-9  # relative: exact data leave rounding below it
_CLEAR = 100.0  # noisy data must show the number of unknown inputs by a gap this large
_ALIKE = 3.0  # two or more values of noise lie within this factor
_NOISE_SAFETY = 3.0  # times what noise may have moved
_TILTED = 0.1  # relative: more than this is seen, whatever the noise
_KNOWN = 3.0  # or this large when the number is given


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeSolution:
    """Xdot = T_x X + T_u U + T_y Ydot with rank T_y = r, D (20); H = T_y, F = T_u, E = T_x for a node without gain.

    Attributes:
        T_x: (n, n) = (I - H C) A.
        T_u: (n, m) = (I - H C) B.
        T_y: (n, p) = H.
        C: (p, n) = Y X^+.
        unknown_inputs: r.
        start: (n,) mean state of the data, where estimates start.
        misfit: |Xdot - T_x X - T_u U - T_y Ydot| / |Xdot|.
        exact: the data carry rounding only.
        tolerance: how far noise may have moved T_x, and C relative to its size.
    """

    T_x: NDArray[np.float64]
    T_u: NDArray[np.float64]
    T_y: NDArray[np.float64]
    C: NDArray[np.float64]
    unknown_inputs: int
    start: NDArray[np.float64]
    misfit: float
    exact: bool = True
    tolerance: float = _EXACT


def solve_node(data: Regressors, unknown_inputs: int | None, *, exact: bool = False) -> NodeSolution | str:
    """Solve (20) for one node, or say which condition fails.

    With Pi the projector that removes X and U, Xdot Pi = Bbar W Pi and Ydot Pi = C Bbar W Pi, so the leading r left
    singular vectors of [Xdot Pi; Ydot Pi] span [Bbar; C Bbar]: T_y = (Xdot Pi)(Ydot Pi)^+ on those r directions has
    rank r, which the plain pseudo-inverse of (20) does not guarantee.

    Args:
        data: the node's data matrices.
        unknown_inputs: r, if it is known.
        exact: the record is known to carry rounding only: all that moves is unknown inputs.
    """
    n, m = len(data.X), len(data.U)
    needed = n + m + 1 + _SPARE
    if data.columns < needed:
        return f"{data.columns} columns, expected at least {needed} for {n} states and {m} known inputs: record longer"
    known = np.vstack([data.U, data.X])
    row_space = _row_space(known)
    if len(row_space) < n + m:
        return f"assumption 5 of D fails: rank [U; X] is {len(row_space)}, expected {n + m}: excite more"
    whole = np.vstack([data.Xdot, data.Ydot])
    left = whole - (whole @ row_space.T) @ row_space
    size = _sizes(whole)[:, None]
    directions, values, _ = np.linalg.svd(left / size, full_matrices=False)
    r, noise = _count(values, float(np.linalg.norm(whole / size, 2)), unknown_inputs, n, exact=exact)
    if r is None:
        listed = ", ".join(f"{value:.2g}" for value in values[: n + 1])
        expected = "a clear gap" if unknown_inputs is None else f"{unknown_inputs} unknown inputs"
        return (
            f"the number of unknown inputs is not clear: singular values {listed}, expected {expected}; "
            "borderline: excite more, or give unknown_inputs"
        )
    in_outputs = directions[n:, :r]
    seen = np.linalg.svd(in_outputs, compute_uv=False) if r else np.ones(1)
    shown = int(np.count_nonzero(seen > max(_EXACT, noise)))
    if r and (len(in_outputs) < r or shown < r):
        total = n + m + r
        return f"condition (18) of D fails: rank [U; Ydot; X] is {n + m + shown}, rank with Xdot {total}"
    Bbar, C_Bbar = np.split(np.linalg.svd(left, full_matrices=False)[0][:, :r], [n])
    T_y = Bbar @ np.linalg.pinv(C_Bbar) if r else np.zeros((n, len(data.Y)))
    scale = np.linalg.norm(known, axis=1, keepdims=True)
    coefficients = (data.Xdot - T_y @ data.Ydot) @ np.linalg.pinv(known / scale) / scale.T
    T_u, T_x = np.split(coefficients, [m], axis=1)
    misfit = data.Xdot - T_x @ data.X - T_u @ data.U - T_y @ data.Ydot
    return NodeSolution(
        T_x=T_x,
        T_u=T_u,
        T_y=np.asarray(T_y),
        C=_output_map(data),
        unknown_inputs=r,
        start=np.mean(data.X, axis=1),
        misfit=float(np.linalg.norm(misfit) / np.linalg.norm(data.Xdot)),
        exact=noise == 0.0,
        tolerance=_moved(misfit, known, 0.0 if noise == 0.0 else noise * float(np.linalg.norm(T_x, 2)) * bool(r)),
    )


def shows_rounding_only(data: Regressors) -> bool:
    """Whether known inputs and fewer unknown ones than states explain Xdot but for rounding, which noise prevents."""
    known = np.vstack([data.U, data.X])
    row_space = _row_space(known)
    size = _sizes(data.Xdot)[:, None]
    values = np.linalg.svd((data.Xdot - (data.Xdot @ row_space.T) @ row_space) / size, compute_uv=False)
    moved = int(np.count_nonzero(values > _EXACT * float(np.linalg.norm(data.Xdot / size, 2))))
    return moved < len(data.X) and data.columns >= len(known) + moved + _SPARE


def undetectable(solution: NodeSolution, *, sampled: bool) -> NDArray[np.complex128]:
    """Values s in the unstable region at which (19), rank [s X - Xdot; U; Y] = n + m + r, fails; empty: may lead.

    They are the unobservable modes of (T_x, C) there; what only noise makes observable is not.
    """
    hidden = unobservable(solution.T_x, solution.C, solution.tolerance)
    modes = np.linalg.eigvals(hidden.T @ solution.T_x @ hidden) if hidden.size else np.zeros(0)
    unstable = np.abs(modes) >= 1.0 - _EXACT if sampled else modes.real >= -_EXACT
    return modes[unstable].astype(np.complex128)


def _moved(misfit: NDArray[np.float64], known: NDArray[np.float64], tilt: float) -> float:
    """How far T_x may be off: by the noise of the fit against the weakest excitation, and by the tilt of T_y."""
    weakest = float(np.linalg.svd(known, compute_uv=False)[-1])
    fitted = float(np.linalg.norm(misfit)) / weakest if weakest > 0.0 else np.inf
    return min(max(_EXACT, _NOISE_SAFETY * (fitted + tilt)), _TILTED)


def _row_space(known: NDArray[np.float64]) -> NDArray[np.float64]:
    """Orthonormal rows spanning those of [U; X]; rows are scaled to unit size first."""
    sizes = np.linalg.norm(known, axis=1, keepdims=True)
    balanced = np.divide(known, sizes, out=np.zeros_like(known), where=sizes > 0.0)
    _, values, right = np.linalg.svd(balanced, full_matrices=False)
    return np.asarray(right[: int(np.count_nonzero(values > _EXACT * np.max(values, initial=_EXACT)))])


def _count(
    values: NDArray[np.float64], scale: float, known: int | None, n: int, *, exact: bool
) -> tuple[int | None, float]:
    """Number r of directions that unknown inputs move, and the first value beyond it relative to the last kept."""
    seen = int(np.count_nonzero(values > _EXACT * scale))
    if (seen < min(n, len(values)) or (exact and seen == n)) and (known is None or known == seen):
        return seen, 0.0  # outputs that copy states leave rank n even of pure noise, so n proves nothing
    possible = [known] if known is not None else list(range(1, n))
    possible = [one for one in possible if 0 < one < min(len(values), seen + 1)]
    if not possible:
        return (0, 1.0) if known == 0 else (None, 1.0)
    gaps = [float(values[one - 1] / max(values[one], _EXACT * scale)) for one in possible]
    best = int(np.argmax(gaps))
    below = values[possible[best] : n]
    alike = len(below) > 1 and below[0] <= _ALIKE * below[-1]  # one value alone may be a weak unknown input as well
    if gaps[best] < _KNOWN or (known is None and not (alike and gaps[best] >= _CLEAR)):
        return None, 1.0
    return possible[best], 1.0 / gaps[best]


def _output_map(data: Regressors) -> NDArray[np.float64]:
    """C = Y X^+; sensors that copy states get their whole numbers, row by row, when the data do not contradict them."""
    size = np.linalg.norm(data.X, axis=1, keepdims=True)
    C = data.Y @ np.linalg.pinv(data.X / size) / size.T
    rounded = np.round(C)
    slack = 1.0 + np.sqrt(C.shape[1] / data.columns)  # what the fit gains from noise alone
    left, fitted = (np.linalg.norm(data.Y - one @ data.X, axis=1) for one in (rounded, C))
    kept = left <= slack * fitted + _EXACT * np.linalg.norm(data.Y, axis=1)
    return np.asarray(np.where(kept[:, None], rounded, C))


def _sizes(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Spread of each row, its size where it never moves, 1 where there is nothing: the units of decisions."""
    moved = np.std(rows, axis=1)
    size = np.where(moved > 0.0, moved, np.max(np.abs(rows), axis=1, initial=0.0))
    return np.asarray(np.where(size > 0.0, size, 1.0))
