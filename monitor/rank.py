"""How many unknown inputs a history shows: the decision on which everything else rests.

The state part of the data, [U_p; X_p; U_f; X_f], has rank 2m + n + m_d when the experiment excites everything, because
X_f = A X_p + B U_p + E D_p. So m_d is the rank of what is left of X_f once [U_p; X_p; U_f] is projected away: the
innovations. Deciding on the innovations keeps a large operating point out of the comparison of singular values.

Taking m_d too large is the blind trap: with m_d = n and C = I the observer copies y and its residual is always zero.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from monitor.errors import HistoryError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.history import DataMatrices

_ROUNDING = 1e-10  # shares of the spread: what counts as rounding in exact data
_ROUNDED = 1e2  # innovations that should be zero are smaller than this many times what rounding is expected to leave
_NOTHING = 1e-15  # relative: what moves less moves by rounding alone
_SPARE = 2  # columns beyond the directions that exact data seem to show, at least
_SPARE_NOISY = 4  # the same where noise has to be told from signal
_EXACT_GAP = 1e2  # exact data leave many decades between what is excited and what is rounding
LOST = 30.0  # how many times its rounding a subspace may be wrong by
_KNOWN_GAP = 3.0  # below it the directions of the known unknown inputs are mixed with noise
_SEARCHED_GAP = 100.0  # a gap that has to be found, not only confirmed: random plants show tenfold gaps by chance
_ABOVE_NOISE = 1.2  # noise alone moves every direction of the states by 1 +- sqrt(n / N)
_CLEAR = 12.0  # below it six standard deviations of the fit are half a motion along the weakest direction
PEAK = 3.0  # standard deviations: Gaussian noise reaches it within some hundred samples
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
        innovation_values: (n,) singular values of the innovations per sample, largest first, in shares of the spread
            of each state.
        excitation: (2m + n,) singular values of [U_p; X_p; U_f] per sample with rows scaled to unit root mean square.
        rounding: size of innovations that double precision alone would cause, in the same shares.
        reason: one line in words.
        clearness: how far the whole record moves the states along their weakest direction, in standard deviations of
            its noise; infinite without noise. A fit to the record is wrong by 1 / clearness of a motion along it.
    """

    unknown_inputs: int | None
    basis: RankBasis
    confidence: float
    innovation_values: NDArray[np.float64]
    excitation: NDArray[np.float64]
    rounding: float
    reason: str
    clearness: float = np.inf

    @property
    def weakest(self) -> float:
        """How far the weakest unknown input moves the states, in shares of their spread; 1 without any."""
        count = self.unknown_inputs or 0
        return float(self.innovation_values[count - 1]) if count else 1.0

    @property
    def tilt(self) -> float:
        """How far rounding alone may tilt the subspace that the record spans."""
        least = min(1.0, max(self.weakest, np.finfo(float).tiny), float(self.excitation[-1]))
        return LOST * self.rounding / least


@dataclass(frozen=True, slots=True, kw_only=True)
class RankOptions:
    """What is known beforehand.

    Attributes:
        unknown_inputs: m_d, if known.
        noise_std: standard deviation of the measurement noise on x in the history, one or n numbers, if known.
        relative_tolerance: what counts as rounding in exact data, relative to the spread of each signal; None: 1e-10,
            and a value that lies above the rounding of double precision as well is said to be ambiguous.
    """

    unknown_inputs: int | None = None
    noise_std: tuple[float, ...] | float | None = None
    relative_tolerance: float | None = None


def decide_rank(
    data: DataMatrices,
    options: RankOptions,
    direct: NDArray[np.float64] | None = None,
    direct_sizes: NDArray[np.float64] | None = None,
) -> RankDecision:
    """Decide how many unknown inputs the history shows; in shares of the spread of each signal, whatever their units.

    Args:
        data: the history.
        options: what is known beforehand.
        direct: (q, N) what unknown inputs add to outputs directly, Y_p - C X_p - D U_p of the outputs they reach.
        direct_sizes: (q,) root mean square of the numbers that `direct` is the difference of; None: its own.

    Raises:
        HistoryError: states and known inputs do not move independently, whatever the unknown inputs do.
    """
    n = len(data.X_f)
    digits = _digits(data)
    spread = _spread(np.hstack([data.X_p, data.X_f]))
    data = replace(data, X_p=data.X_p / spread, X_f=data.X_f / spread)
    tolerance = options.relative_tolerance or _ROUNDING
    driven = data.X_f if direct is None else np.vstack([data.X_f, direct / _spread(direct)])
    sizes = np.sqrt(np.mean(driven**2, axis=1))
    if direct is not None and direct_sizes is not None:
        sizes[n:] = direct_sizes / _spread(direct)[:, 0]
    projection = project(np.vstack([data.U_p, data.X_p, data.U_f]), driven, tolerance, sizes)
    values = projection.values
    seen = int(np.count_nonzero(values > tolerance))
    if seen < len(values):
        certain = options.relative_tolerance is not None
        levels = np.zeros(len(values)) if certain else projection.levels
        verdict = _exact(values, seen, options.unknown_inputs, levels)
    elif len(values) > n:
        verdict = _direct(values)
    elif options.unknown_inputs is not None:
        noisy = singular_values(projection.rest * spread)  # noise is presumed equal in the units at hand
        values = noisy * (values[0] / noisy[0])
        verdict = _known(values, options.unknown_inputs)
    elif options.noise_std is not None:
        noise_std = np.broadcast_to(np.asarray(options.noise_std, dtype=float), (n,)) / spread[:, 0]
        verdict = _noise_level(data, projection.rest, noise_std)
    else:
        verdict = _gap(values, projection.rounding * digits / float(np.finfo(float).eps))
    unknown_inputs, basis, confidence, reason = verdict
    clearness = np.inf
    if unknown_inputs is not None and basis is not RankBasis.EXACT:
        level = _implied(data, projection.rest, unknown_inputs, spread)
        if options.noise_std is not None:
            level = np.broadcast_to(np.asarray(options.noise_std, dtype=float), (n,)) / spread[:, 0]
        clearness, buried = _above_noise(data, level)
        unknown_inputs, reason = (None, buried) if buried else (unknown_inputs, reason)
    spare = data.columns - len(projection.excitation) - (unknown_inputs or 0)
    if unknown_inputs is not None and spare < (needed := _SPARE if basis is RankBasis.EXACT else _SPARE_NOISY):
        unknown_inputs, confidence, reason = None, 0.0, _too_few(data.columns, spare, needed)
    return RankDecision(
        unknown_inputs=unknown_inputs,
        basis=basis,
        confidence=confidence,
        innovation_values=values,
        excitation=projection.excitation,
        rounding=projection.rounding,
        reason=reason,
        clearness=clearness,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Projection:
    """What is left of some rows once others are projected away.

    Attributes:
        rest: (n, N) the innovations.
        values: (n,) their singular values per sample, largest first.
        excitation: (k,) singular values per sample of the regressors, rows scaled to unit root mean square.
        rounding: size that double precision alone gives to innovations that should be zero, at most.
        levels: (n,) size that it gives to each of the values where it is no more than their sum of squares.
    """

    rest: NDArray[np.float64]
    values: NDArray[np.float64]
    excitation: NDArray[np.float64]
    rounding: float
    levels: NDArray[np.float64]


def project(
    regressors: NDArray[np.float64],
    target: NDArray[np.float64],
    tolerance: float,
    sizes: NDArray[np.float64] | None = None,
) -> Projection:
    """Project the regressors (k, N) out of the target (n, N); both keep their rounding, not that of the condition.

    Args:
        regressors: (k, N).
        target: (n, N).
        tolerance: relative: below it regressors follow from one another.
        sizes: (n,) root mean square of the numbers whose rounding the target carries; None: its own.

    Raises:
        HistoryError: the regressors follow from one another.
    """
    count, columns = regressors.shape
    sizes = np.sqrt(np.mean(target**2, axis=1)) if sizes is None else sizes
    largest = np.max(np.abs(regressors), axis=1, keepdims=True)
    balanced = regressors / np.where(largest > 0.0, largest, 1.0)
    moved = np.sqrt(np.mean(balanced**2, axis=1, keepdims=True))
    balanced = balanced / np.where(moved > 0.0, moved, 1.0)
    excitation = np.linalg.svd(balanced, compute_uv=False)
    rank = int(np.count_nonzero(excitation > tolerance * excitation[0]))
    if rank < count:
        weakest = float(excitation[min(rank, len(excitation) - 1)] / excitation[0])
        close = ", borderline" if weakest > _NOTHING else ""
        raise HistoryError(
            f"the history is not exciting{close}: [U_p; X_p; U_f] has rank {rank}, expected {count} (the next singular "
            f"value is {weakest:.2g} of the largest): start from several random states or vary the inputs more"
        )
    directions, triangle = np.linalg.qr(balanced.T)
    along = target @ directions
    rest = target - along @ directions.T
    rest = rest - (rest @ directions) @ directions.T  # once more: what the first round left behind by rounding
    gains = np.linalg.solve(triangle, along.T).T  # target = gains @ balanced + rest
    largest = np.abs(gains) @ np.max(np.abs(balanced), axis=1) + np.max(np.abs(target), axis=1)
    rounding = float(np.finfo(float).eps * np.linalg.norm(largest))
    left, found, _ = np.linalg.svd(rest, full_matrices=False)
    values = _padded(found / np.sqrt(columns), len(rest))
    # samples are rounded independently: (1, gains) along each direction adds up in squares
    carried = left.T @ np.hstack([np.diag(sizes), gains])
    levels = _padded(np.finfo(float).eps * np.linalg.norm(carried, axis=1), len(rest))
    return Projection(
        rest=rest, values=values, excitation=excitation / np.sqrt(columns), rounding=rounding, levels=levels
    )


def singular_values(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) singular values per sample of rows (n, N); zeros where there are fewer columns than rows."""
    return _padded(np.linalg.svd(rows, compute_uv=False) / np.sqrt(rows.shape[1]), len(rows))


def _padded(values: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    return np.pad(values, (0, count - len(values)))


def _implied(
    data: DataMatrices, innovations: NDArray[np.float64], unknown_inputs: int, spread: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n,) noise, equal in the units at hand, that explains q' (w_t+1 - A w_t), q a direction of mere noise.

    Data, innovations and answer are in shares of the spread (n, 1). Rounding that shrinks with a signal that dies out
    is largest where the signal is, so that a third of the peak counts where it is more than the mean.
    """
    n = len(data.X_p)
    if unknown_inputs >= n:
        return np.zeros(n)
    left = np.linalg.svd(innovations * spread, full_matrices=False)[0]
    A = np.linalg.lstsq(np.vstack([data.X_p, data.U_p, data.U_f]).T, data.X_f.T, rcond=None)[0].T[:, :n]
    direction = left[:, unknown_inputs]
    amplified = np.sqrt(1.0 + float(np.sum((direction @ (spread * A / spread[:, 0])) ** 2)))
    noise = direction @ (innovations * spread)
    level = max(float(np.sqrt(np.mean(noise**2))), float(np.max(np.abs(noise))) / PEAK)
    return np.asarray(level / amplified / spread[:, 0])


def _above_noise(data: DataMatrices, level: NDArray[np.float64]) -> tuple[float, str]:
    """How clearly all directions of the states move above noise of this level (n,), and why it is not enough."""
    if not np.all(level > 0.0):
        return np.inf, ""
    inputs = np.linalg.qr(np.vstack([data.U_p, data.U_f]).T)[0]
    moved = data.X_p / level[:, None]
    weakest = float(singular_values(moved - (moved @ inputs) @ inputs.T)[-1])
    clearness = float(np.sqrt(data.columns * max(weakest**2 - 1.0, 0.0)))
    if weakest >= _ABOVE_NOISE and clearness >= _CLEAR:
        return clearness, ""
    return clearness, (
        f"not exciting, borderline: the whole record moves some direction of the states by only {clearness:.2g} times "
        f"the noise, expected {_CLEAR:g}: start from several random states, vary the inputs more, record longer or "
        "with less noise"
    )


def _spread(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 1) standard deviations, 1 for a row that never moves."""
    sizes = np.max(np.abs(rows), axis=1, keepdims=True)
    spread = sizes * np.std(rows / np.where(sizes > 0.0, sizes, 1.0), axis=1, keepdims=True)
    return np.where(spread > 0.0, spread, 1.0)


def _too_few(columns: int, spare: int, needed: int) -> str:
    """With as many columns as directions any rank is found."""
    return (
        f"{columns} pairs of consecutive samples leave {max(spare, 0)} beyond the directions that they seem to show, "
        f"expected {needed}: with fewer any number of unknown inputs would be found; record {needed - spare} more"
    )


_Verdict = tuple[int | None, RankBasis, float, str]


def _exact(values: NDArray[np.float64], seen: int, known: int | None, levels: NDArray[np.float64]) -> _Verdict:
    """Data without noise: the rank is what stands above rounding; levels 0 when the tolerance is taken as given."""
    gap = np.inf if seen == 0 or values[seen] == 0.0 else values[seen - 1] / values[seen]
    above = np.flatnonzero(values > _ROUNDED * levels) if np.any(levels) else np.arange(seen)
    hidden = max(seen, int(above[-1]) + 1 if len(above) else 0)
    if known is not None and known != seen and not (seen < known <= hidden):
        fix = "vary all of them" if known > seen else "give the right number"
        reason = f"unknown_inputs is {known}, but exact data show {seen}: not exciting, or another number; {fix}"
        return None, RankBasis.EXACT, 1.0, reason
    if known is not None and known > seen:
        gap, seen, hidden = (
            values[known - 1] / max(values[known], levels[known]) if known < len(values) else 0.0,
            known,
            0,
        )
    if gap < _EXACT_GAP:
        return (
            None,
            RankBasis.EXACT,
            0.0,
            (
                f"ambiguous rank: singular values {values[seen - 1]:.2g} and {values[min(seen, len(values) - 1)]:.2g} "
                "lie on both sides of rounding; excite more, or give unknown_inputs"
            ),
        )
    if hidden > seen and known is None:
        return (
            None,
            RankBasis.EXACT,
            0.0,
            (
                f"ambiguous rank, borderline: a singular value of {values[seen]:.2g} of the spread lies above the "
                f"rounding of double precision ({levels[seen]:.1g}): an unknown input that is hardly excited, or "
                "samples with fewer digits; give unknown_inputs or relative_tolerance, or excite more"
            ),
        )
    return seen, RankBasis.EXACT, 1.0, f"exact data show {seen} unknown inputs"


def _direct(values: NDArray[np.float64]) -> _Verdict:
    """Noise and unknown inputs in one output are told apart in exact data only."""
    return (
        None,
        RankBasis.EXACT,
        0.0,
        (
            f"unknown inputs act on outputs directly (y = C x + D u + G d), and singular values {_listed(values)} "
            "leave no zero: that takes an exact history; record without noise, or leave these outputs out"
        ),
    )


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
            (
                f"ambiguous rank, borderline: a singular value is only {gap:.2g} times the noise; "
                "excite more or give unknown_inputs"
            ),
        )
    return (
        seen,
        RankBasis.NOISE_LEVEL,
        1.0 - 1.0 / max(gap, 1.0),
        f"{seen} unknown inputs above the noise level, which would hide a weaker one",
    )


def _digits(data: DataMatrices) -> float:
    """Relative rounding of the recorded states: that of float32 where every number is one, else of double precision."""
    for table in (data.X_p, data.X_f):
        if not np.array_equal(table, table.astype(np.float32)):
            return float(np.finfo(float).eps)
    return float(np.finfo(np.float32).eps)


def _gap(values: NDArray[np.float64], rounding: float) -> _Verdict:
    """Nothing is given: what lies above rounding must lie far above, and something must lie below.

    Noise of unknown size is never believed: it could be an unknown input that is weakly excited.
    """
    seen = int(np.count_nonzero(values > rounding))
    gap = float(values[seen - 1] / values[seen]) if 0 < seen < len(values) else 0.0
    if gap < _SEARCHED_GAP:
        return (
            None,
            RankBasis.GAP,
            0.0,
            (
                f"ambiguous rank: the singular values {_listed(values)} of the innovations may be noise or unknown "
                "inputs that are weakly excited; give unknown_inputs or noise_std"
            ),
        )
    words = f"{seen} unknown inputs by the singular values {_listed(values)}; below is the rounding of float32"
    return seen, RankBasis.GAP, 1.0 - 1.0 / gap, words


def _listed(values: NDArray[np.float64]) -> str:
    return ", ".join(f"{value:.2g}" for value in values)
