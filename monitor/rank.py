"""How many unknown inputs a history shows: the decision on which everything else rests.

The state part of the data, [U_p; X_p; U_f; X_f], has rank 2m + n + m_d when the experiment excites everything, because
X_f = A X_p + B U_p + E D_p. So m_d is the rank of what is left of X_f once [U_p; X_p; U_f] is projected away: the
innovations. Deciding on the innovations keeps a large operating point out of the comparison of singular values.

Taking m_d too large is the blind trap: with m_d = n and C = I the observer copies y and its residual is always zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from monitor.errors import HistoryError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.history import DataMatrices

_EXACT_GAP = 1e2  # exact data leave many decades between what is excited and what is rounding
_KNOWN_GAP = 3.0  # below it the directions of the known unknown inputs are mixed with noise
_SEARCHED_GAP = 100.0  # a gap that has to be found, not only confirmed: random plants show tenfold gaps by chance
_RUNNER_UP = 10.0  # and it must be larger by this than the next one
_NOISE_SPREAD = 1.5  # singular values of pure noise spread by sqrt(n / N) about 1, wider for noise at two instants
_OVERSTATED = 0.2  # noise values below this share of the stated level contradict it


class RankBasis(Enum):
    """What the decision rests on."""

    EXACT = "exact"
    KNOWN = "known unknown_inputs"
    NOISE_LEVEL = "known noise level"
    GAP = "singular-value gap"


@dataclass(frozen=True, slots=True, kw_only=True)
class RankDecision:
    """Number of unknown inputs in the data, or why it cannot be told.

    Attributes:
        unknown_inputs: m_d, or None when the data do not tell.
        basis: what the decision rests on.
        confidence: 0 to 1, how far the decision is from the next possible one (1 - second gap / gap).
        innovation_values: (n,) singular values of the innovations per sample, largest first, units of x.
        excitation: (2m + n,) singular values of [U_p; X_p; U_f] per sample with rows scaled to unit root mean square.
        reason: one line in words.
    """

    unknown_inputs: int | None
    basis: RankBasis
    confidence: float
    innovation_values: NDArray[np.float64]
    excitation: NDArray[np.float64]
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RankOptions:
    """What is known beforehand.

    Attributes:
        unknown_inputs: m_d, if known.
        noise_std: standard deviation of the measurement noise on x in the history, one or n numbers, if known.
        relative_tolerance: what counts as rounding in exact data, relative to the largest signal.
    """

    unknown_inputs: int | None = None
    noise_std: tuple[float, ...] | float | None = None
    relative_tolerance: float = 1e-10


def decide_rank(data: DataMatrices, options: RankOptions) -> RankDecision:
    """Decide how many unknown inputs the history shows.

    Raises:
        HistoryError: states and known inputs do not move independently, whatever the unknown inputs do.
    """
    n = len(data.X_f)
    regressors = np.vstack([data.U_p, data.X_p, data.U_f])
    row_space, excitation = _row_space(regressors, options.relative_tolerance)
    innovations = data.X_f - (data.X_f @ row_space.T) @ row_space
    values = np.linalg.svd(innovations, compute_uv=False)[:n] / np.sqrt(data.columns)
    values = np.pad(values, (0, n - len(values)))
    scale = float(np.linalg.norm(data.X_f, 2) / np.sqrt(data.columns))
    seen = int(np.count_nonzero(values > options.relative_tolerance * scale))
    if seen < n:
        verdict = _exact(values, seen, options.unknown_inputs)
    elif options.unknown_inputs is not None:
        verdict = _known(values, options.unknown_inputs)
    elif options.noise_std is not None:
        verdict = _noise_level(data, innovations, np.broadcast_to(np.asarray(options.noise_std, dtype=float), (n,)))
    else:
        verdict = _gap(values, _balanced_values(data, innovations))
    unknown_inputs, basis, confidence, reason = verdict
    return RankDecision(
        unknown_inputs=unknown_inputs,
        basis=basis,
        confidence=confidence,
        innovation_values=values,
        excitation=excitation,
        reason=reason,
    )


_Verdict = tuple[int | None, RankBasis, float, str]


def _row_space(regressors: NDArray[np.float64], tolerance: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Orthonormal basis (rows) of the row space of [U_p; X_p; U_f] and its scaled singular values."""
    count, columns = regressors.shape
    balanced = regressors / np.sqrt(np.mean(regressors**2, axis=1, keepdims=True))
    _, values, directions = np.linalg.svd(balanced, full_matrices=False)
    rank = int(np.count_nonzero(values > tolerance * values[0]))
    if rank < count:
        raise HistoryError(
            f"the history is not exciting: [U_p; X_p; U_f] has rank {rank}, expected {count}: "
            "start from several random states or vary the inputs more"
        )
    return directions, values / np.sqrt(columns)


def _exact(values: NDArray[np.float64], seen: int, known: int | None) -> _Verdict:
    """Data without noise: the rank is what stands above rounding."""
    gap = np.inf if seen == 0 or values[seen] == 0.0 else values[seen - 1] / values[seen]
    if known is not None and known != seen:
        fix = "vary all of them" if known > seen else "give the right number"
        reason = f"unknown_inputs is {known}, but exact data show {seen}: not exciting, or another number; {fix}"
        return None, RankBasis.EXACT, 1.0, reason
    if gap < _EXACT_GAP:
        return (
            None,
            RankBasis.EXACT,
            0.0,
            (
                f"ambiguous rank: singular values {values[seen - 1]:.2g} and {values[seen]:.2g} lie on both sides of "
                "rounding; excite more, or give unknown_inputs"
            ),
        )
    return seen, RankBasis.EXACT, 1.0, f"exact data show {seen} unknown inputs"


def _known(values: NDArray[np.float64], known: int) -> _Verdict:
    """The number is given: check that it separates signal from noise."""
    n = len(values)
    if not 0 <= known <= n:
        return None, RankBasis.KNOWN, 0.0, f"unknown_inputs is {known}, expected 0 to {n} for {n} states"
    if known in (0, n):
        return known, RankBasis.KNOWN, 1.0, f"{known} unknown inputs as given"
    gap = float(values[known - 1] / values[known])
    if gap < _KNOWN_GAP:
        return (
            None,
            RankBasis.KNOWN,
            1.0 - 1.0 / gap,
            (
                f"too noisy for {known} unknown inputs: singular values {_listed(values)} of the innovations are not "
                f"{_KNOWN_GAP:g} apart there; excite more or record with less noise"
            ),
        )
    return known, RankBasis.KNOWN, 1.0 - 1.0 / gap, f"{known} unknown inputs as given, {gap:.2g} above the noise"


def _noise_level(data: DataMatrices, innovations: NDArray[np.float64], noise_std: NDArray[np.float64]) -> _Verdict:
    """The noise level is given: count what stands above the innovations that it alone would cause."""
    n, columns = len(noise_std), data.columns
    if not np.all(noise_std > 0.0):
        return None, RankBasis.NOISE_LEVEL, 0.0, f"noise_std is {noise_std.tolist()}, expected positive numbers"
    A = (data.X_f @ np.linalg.pinv(np.vstack([data.X_p, data.U_p, data.U_f])))[:, :n]
    covariance = np.diag(noise_std**2) + A @ np.diag(noise_std**2) @ A.T
    whitened = np.linalg.solve(np.linalg.cholesky(covariance), innovations)
    values = np.linalg.svd(whitened, compute_uv=False) / np.sqrt(columns)
    ceiling = 1.0 + _NOISE_SPREAD * float(np.sqrt(n / columns))
    seen = int(np.count_nonzero(values > ceiling))
    if seen < n and values[seen] < _OVERSTATED:
        return (
            None,
            RankBasis.NOISE_LEVEL,
            0.0,
            (f"noise_std is {1.0 / values[seen]:.2g} times what the history shows; correct it or give unknown_inputs"),
        )
    gap = float(values[seen - 1] / (values[seen] if seen < n else ceiling)) if seen else float(ceiling / values[0])
    if seen and gap < _KNOWN_GAP:
        return (
            None,
            RankBasis.NOISE_LEVEL,
            1.0 - 1.0 / gap,
            (f"ambiguous rank: a singular value is only {gap:.2g} times the noise; excite more or give unknown_inputs"),
        )
    return (
        seen,
        RankBasis.NOISE_LEVEL,
        1.0 - 1.0 / max(gap, 1.0),
        f"{seen} unknown inputs above the noise level, which would hide a weaker one",
    )


def _balanced_values(data: DataMatrices, innovations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Singular values of the innovations with every state scaled to unit spread."""
    spread = np.std(data.X_f, axis=1, keepdims=True)
    return np.asarray(np.linalg.svd(innovations / spread, compute_uv=False) / np.sqrt(data.columns))


def _gap(values: NDArray[np.float64], balanced: NDArray[np.float64]) -> _Verdict:
    """Nothing is given: one gap must stand out, in SI units and with every state scaled to unit spread alike."""
    best, confidence = _largest_gap(values)
    other, other_confidence = _largest_gap(balanced)
    confidence = min(confidence, other_confidence)
    if best is None or best != other:
        return (
            None,
            RankBasis.GAP,
            0.0 if best != other else confidence,
            (
                f"ambiguous rank: no gap of {_SEARCHED_GAP:g} stands out in the singular values {_listed(values)} "
                "of the innovations; give unknown_inputs or noise_std"
            ),
        )
    return best, RankBasis.GAP, confidence, f"{best} unknown inputs by the singular values {_listed(values)}"


def _largest_gap(values: NDArray[np.float64]) -> tuple[int | None, float]:
    """Index of the largest ratio of neighbouring singular values, None when it does not stand out.

    What lies below it must be flat, as noise is: a second gap there may be a weakly excited unknown input.
    """
    if len(values) < 2:  # noqa: PLR2004 - one value has no neighbour
        return None, 0.0
    gaps = values[:-1] / values[1:]
    best = int(np.argmax(gaps))
    runner_up = float(np.max(np.delete(gaps, best), initial=1.0))
    confidence = 1.0 - runner_up / float(gaps[best])
    stands_out = gaps[best] >= max(_SEARCHED_GAP, _RUNNER_UP * runner_up)
    flat = bool(np.all(gaps[best + 1 :] < _KNOWN_GAP))
    return (best + 1 if stands_out and flat else None), confidence


def _listed(values: NDArray[np.float64]) -> str:
    return ", ".join(f"{value:.2g}" for value in values)
