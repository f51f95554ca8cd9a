"""Exact decoupling: when the unknown inputs can be cancelled altogether, and the gain that does it.

Exact decoupling with delay delta exists iff rank Gamma_delta - rank Gamma_delta-1 = rank [B; D] (Sundaram and
Hadjicostis; theory section 7), and then L = Phi Gamma^+ + F N with N the left null space of Gamma and F free. The error
dynamics Q = A - L Theta can be made Schur iff the invariant zeros of (A, B, C, D) lie in the unit circle.

Both conditions are decided with the shortest window for which the first holds: it holds for every longer one then, and
no gain moves other modes there. In longer windows a zero z outside the circle makes singular values of Gamma of the
size |z|^-delta, which soon look like rounding.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from monitor.acceptor import unobservable
from monitor.delayed.model import window_of
from monitor.freedom.assignment import canonical_basis
from monitor.riccati import dual_lqr

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.delayed.model import Model, Window

_RANK = 1e-9  # relative: singular values below it are zero
_FAINT = 1e-5  # what is seen by more is seen, however far off the model may be
_AMBIGUOUS = 1e-7  # those between rounding and this one may or may not be zero
_ROUNDING = 1e-13  # relative: what zero looks like
_EXACT = 1e-9  # relative: what a gain may leave of the unknown inputs
_SCHUR = 1.0 - 1e-9
_CIRCLE = 1e-6  # zeros closer to the unit circle than this are borderline


@dataclass(frozen=True, slots=True, kw_only=True)
class Decoupling:
    """What exact decoupling takes and whether it is there.

    Attributes:
        gained_rank: rank Gamma_delta - rank Gamma_delta-1.
        needed_rank: rank [B; D].
        L: a stable exactly decoupling gain (n, (delta + 1) p), None when there is none.
        radius: spectral radius with that gain, or of the zeros that no gain moves; None when the ranks do not match.
        enough: smallest delay for which the ranks match, None when none is.
        doubt: what lies so close to its limit that rounding may have decided; else empty.
        N: (f, (delta + 1) p) orthonormal rows of the left null space of Gamma, None without a gain.
    """

    gained_rank: int
    needed_rank: int
    L: NDArray[np.float64] | None = None
    N: NDArray[np.float64] | None = None
    radius: float | None = None
    enough: int | None = None
    doubt: str = ""

    @property
    def possible(self) -> bool:
        """Whether the ranks match."""
        return self.gained_rank >= self.needed_rank

    @property
    def reason(self) -> str:
        """One line on what is missing, empty when nothing is."""
        doubt = f"borderline, {self.doubt}: " if self.doubt else ""
        if not self.possible:
            mend = "no delay is enough" if self.enough is None else f"delay {self.enough} is enough"
            ranks = f"rank Gamma_delta - rank Gamma_delta-1 is {self.gained_rank}, expected {self.needed_rank}"
            return f"{doubt}{mend}: {ranks}"
        if self.L is not None:
            return ""
        if (self.radius or 0.0) < _SCHUR:
            return f"{doubt}no gain is found that cancels them in double precision"
        return f"{doubt}an invariant zero of modulus >= 1 keeps the radius at {self.radius:.4g}"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Gains:
    """All exactly decoupling gains L0 + F N of one window.

    Attributes:
        L0: the one of least norm.
        error: A - L0 Theta.
        N: rows of the left null space of Gamma.
        seen: N Theta, what F works with.
    """

    L0: NDArray[np.float64]
    error: NDArray[np.float64]
    N: NDArray[np.float64]
    seen: NDArray[np.float64]

    def stable(self, hidden: float) -> NDArray[np.float64] | None:
        """L0 + F N with F of the dual LQR; None when that finds no stable one. What is seen by less is hidden."""
        F = _stabilise(self.error, self.seen, hidden)
        return None if F is None else np.asarray(self.L0 + F @ self.N, dtype=np.float64)


def decouple(model: Model, window: Window, tolerance: float = _RANK) -> Decoupling:
    """Decide on exact decoupling and design it by a dual LQR (weights I, I) on (A - Phi Gamma^+ Theta, N Theta).

    Args:
        model: the plant, in units in which signals are of like size; that of the unknown inputs does not matter.
        window: its outputs over delta + 1 samples.
        tolerance: how far the model may be off, relative: a smaller singular value is not told from zero.
    """
    model = _normalised(model)
    window = window_of(model, window.delay)
    needed, delay = model.B.shape[1], window.delay
    ranks, doubt = _ranks(model, max(delay, len(model.A)), tolerance)
    gains = np.diff([0, *ranks])
    enough = len(gains) - 1 if gains[-1] >= needed else None
    if enough is None or enough > delay:
        return Decoupling(gained_rank=int(gains[delay]), needed_rank=needed, enough=enough, doubt=doubt)
    shortest = _gains(model, window_of(model, enough), ranks[enough])
    hidden = min(max(tolerance, _RANK), _FAINT)
    fixed = _hidden_radius(shortest.error, shortest.seen, hidden)
    if abs(fixed - 1.0) < _CIRCLE:
        doubt = f"a zero has modulus {fixed:.9g}"
    found = Decoupling(gained_rank=needed, needed_rank=needed, radius=fixed, enough=enough, doubt=doubt)
    if fixed >= _SCHUR:
        return found
    whole = _gains(model, window, ranks[enough] + needed * (delay - enough))
    for tried in (whole, shortest) if delay > enough else (whole,):
        gain = tried.stable(hidden)
        if gain is None:
            continue
        L = np.hstack([gain, np.zeros((len(gain), len(window.Theta) - gain.shape[1]))])  # later samples are not used
        radius = float(np.max(np.abs(np.linalg.eigvals(model.A - L @ window.Theta)), initial=0.0))
        left = float(np.linalg.norm(L @ window.Gamma - window.Phi))
        if radius < _SCHUR and left <= _EXACT * (1.0 + float(np.linalg.norm(L))):
            return replace(found, L=L, radius=radius, N=whole.N)
    return found


def _normalised(model: Model) -> Model:
    """Unknown inputs in units in which each acts with norm 1."""
    size = np.linalg.norm(model.G, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    return replace(model, B=model.B / size, D=model.D / size)


def _gains(model: Model, window: Window, rank: int) -> _Gains:
    left, values, right = np.linalg.svd(window.Gamma)
    L0 = (window.Phi @ right[:rank].T / values[:rank]) @ left[:, :rank].T
    N = left[:, rank:].T
    return _Gains(L0=L0, error=model.A - L0 @ window.Theta, N=N, seen=N @ window.Theta)


def _ranks(model: Model, longest: int, tolerance: float) -> tuple[list[int], str]:
    """Rank of Gamma_0, Gamma_1, … up to the first that suffices, and a word when one of them is in doubt."""
    ranks, doubt = [0], ""
    reach = float(np.linalg.norm(np.hstack([model.C, model.D]), 2))  # of an input that moves state and outputs by 1
    for delay in range(longest + 1):
        values = np.linalg.svd(window_of(model, delay).Gamma, compute_uv=False)
        share = values / max(float(np.max(values, initial=0.0)), reach, _ROUNDING)
        ranks.append(int(np.count_nonzero(share > tolerance)))
        weak = share[(share > _ROUNDING) & (share < max(_AMBIGUOUS, 10.0 * tolerance))]
        if len(weak) and not doubt:
            doubt = f"a singular value of Gamma_{delay} is {weak[0]:.1g} of the largest"
        if ranks[-1] - ranks[-2] >= model.B.shape[1]:
            break
    return ranks[1:], doubt


def _hidden_radius(A: NDArray[np.float64], C: NDArray[np.float64], tolerance: float) -> float:
    """Largest modulus of the modes that no F in A - F C moves: the invariant zeros of the plant."""
    hidden = unobservable(A, C, tolerance)
    return float(np.max(np.abs(np.linalg.eigvals(hidden.T @ A @ hidden)), initial=0.0)) if hidden.size else 0.0


def _stabilise(A: NDArray[np.float64], C: NDArray[np.float64], tolerance: float) -> NDArray[np.float64] | None:
    """F (n, rows of C) of the dual LQR that makes A - F C Schur on what C sees; None when none is found."""
    if not C.size or np.max(np.abs(C)) <= _RANK:
        return np.zeros((len(A), len(C)))
    left, values, right = np.linalg.svd(C, full_matrices=False)
    rank = int(np.count_nonzero(values > tolerance * np.max(values, initial=_RANK)))
    hidden = unobservable(A, right[:rank], tolerance)
    if hidden.shape[1]:
        seen = canonical_basis(np.eye(len(A)) - hidden @ hidden.T, len(A) - hidden.shape[1])
        gain = dual_lqr(seen.T @ A @ seen, right[:rank] @ seen)
        gain = None if gain is None else seen @ gain
    else:
        gain = dual_lqr(A, right[:rank])  # orthonormal combinations of the rows: it does not depend on how N is scaled
    return None if gain is None else np.asarray((gain / values[:rank]) @ left[:, :rank].T, dtype=np.float64)
