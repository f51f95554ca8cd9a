"""Every design proves itself on samples that it has not seen.

Part of the history is held back from the design. The finished observer runs over it, free of attack, and its error and
residual are held against what rounding, or the noise, allows. Whatever runs by init and step can be proved: give its
`Trial`s on seen and unseen samples (`monitor.trials` runs state observers) and an `Allowance`; `prove` makes
the `Proof` that a certificate carries.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from monitor.history import Experiment, History

_SHARE = 5  # one sample, or one experiment, in five is held back
_FEWEST = 2  # samples held back at least
_WHOLE = 4  # from so many experiments on whole ones are held back, else the tail of each
_EXACT = 1e-6  # shares of the spread: an error above is not exact, however ill the history is conditioned
_PEAKS = 3.0  # rounding to few digits grows with the signal: it is no Gaussian noise, and its peaks fall anywhere
_LOST = 1e4  # the algebra of a design, ill conditioned as the plant is, loses four digits more than the samples
_USELESS = 0.5  # shares of the spread: an estimate further off is hardly better than the mean of the history
_WORTHLESS = 1.0  # shares of the spread: an error as large as all that moves is allowed by no noise
_BY_ROUNDING = "rounding"
_NEAR = 10.0  # times what rounding allows, or a tenth of it
_NEAR_NOISE = 2.0  # times what noise allows
_HARDLY = 10.0  # times what is allowed: a doubt that is larger must be told
SIGMAS = 6.0  # Gaussian noise crosses it in two samples of a billion


@dataclass(frozen=True, slots=True, kw_only=True)
class Split:
    """A history in two parts.

    Attributes:
        seen: what the design may look at.
        unseen: what is held back; the first `overlap` samples of each experiment only start the observer.
        overlap: samples that are not judged.
    """

    seen: History
    unseen: History
    overlap: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """What came out of a run over recorded samples, in the units of the history that was run.

    Attributes:
        error: (T, k) estimate minus truth; k is 0 for an observer that estimates no recorded signal.
        residual: (T, p), p is 0 when there is none.
        size: largest signal of the run.
    """

    error: NDArray[np.float64]
    residual: NDArray[np.float64]
    size: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Allowance:
    """Largest error and residual that are no contradiction, in scaled units.

    Attributes:
        error: (k,) or one number for all.
        residual: (p,) or one number for all.
        basis: what allows them, a few words.
    """

    error: NDArray[np.float64] | float
    residual: NDArray[np.float64] | float
    basis: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Proof:
    """How a finished design did on samples that it had not seen.

    Attributes:
        samples: unseen samples that were judged.
        spare_columns: columns beyond the number of directions that the plant spans: each of them would have shown one
            more unknown input, so that with none of them any rank is "found".
        estimate: what is estimated, a word.
        worst_error: in shares of the signals' spread, None when nothing recorded is estimated.
        worst_residual: likewise.
        allowed_error: the allowance of the signal that comes closest to it, in shares of its spread.
        allowed_residual: likewise.
        errors: (k,) worst error of each signal, the user's units.
        residuals: (p,) worst residual of each output, the user's units.
        basis: what allows them.
        holds: nothing is above what is allowed, and there was something to judge.
        close: the figures lie so near to what rounding allows, below or above, that another record of the same plant
            might turn the answer.
        hardly: what a motion of one spread along the direction that the record excites least may leave in the estimate,
            in shares of the spread; 0 where that is no more than what rounding allows, or ten times what noise allows.
            No sample of the same record can show it.
    """

    samples: int
    spare_columns: int
    estimate: str
    worst_error: float | None
    worst_residual: float | None
    allowed_error: float | None
    allowed_residual: float | None
    errors: NDArray[np.float64]
    residuals: NDArray[np.float64]
    basis: str
    holds: bool
    close: bool = False
    hardly: float = 0.0

    def words(self) -> str:
        """The figures in a few words: "on 40 unseen samples: estimate within 2e-13, residual within 4e-14"."""
        parts = []
        if self.worst_error is not None:
            parts.append(f"{self.estimate} within {self.worst_error:.1g}")
        if self.worst_residual is not None:
            parts.append(f"residual within {self.worst_residual:.1g}")
        words = f"on {self.samples} unseen samples: {', '.join(parts) or 'nothing to judge'}"
        if self.close:
            words += f"; borderline: {self.basis} allows {self.allowed_error or self.allowed_residual:.1g}"
        if self.hardly:
            words += f"; borderline: a motion that the record hardly excites may leave {self.hardly:.1g} of the spread"
        return words

    def lines(self) -> list[str]:
        """The proof as lines of text for a terminal."""
        allowed = [f"{name} {value:.2g}" for name, value in self._allowed() if value is not None]
        return [
            f"proof: {self.words()} of the signals' spread, allowed by {self.basis}: {', '.join(allowed)}",
            f"spare columns: {self.spare_columns}, each of which would have shown a further unknown input",
        ]

    def refusal(self) -> str:
        """Why the design is not believed, one line."""
        if not self.samples:
            return "no unseen sample can be judged: the samples held back hold gaps; record longer"
        found = [
            f"{name} {worst:.2g}, allowed {allowed:.2g}"
            for (name, allowed), worst in zip(self._allowed(), (self.worst_error, self.worst_residual), strict=True)
            if worst is not None and allowed is not None and not worst <= allowed
        ]
        close = "borderline: " if self.close else ""
        return (
            f"{close}not true on {self.samples} unseen samples ({'; '.join(found)} of the signals' spread, "
            f"by {self.basis}): what the history shows does not carry over; record longer, excite everything, or check "
            "units and clocks"
        )

    def _allowed(self) -> tuple[tuple[str, float | None], tuple[str, float | None]]:
        return ((f"{self.estimate} error", self.allowed_error), ("residual", self.allowed_residual))


def hold_back(history: History, overlap: int = 1) -> Split:
    """Hold back every fifth experiment where there are several, else the last fifth of each.

    Args:
        history: all experiments.
        overlap: samples that an observer needs before it can be judged; the tail of an experiment begins that much
            earlier, so that no unseen sample is lost.
    """
    experiments = history.experiments
    long_enough = [number for number, one in enumerate(experiments) if len(one.y) > overlap]
    if len(experiments) >= _WHOLE and long_enough:
        count = max(1, len(long_enough) // _SHARE)
        held = {long_enough[(2 * j + 1) * len(long_enough) // (2 * count)] for j in range(count)}
        seen = tuple(one for number, one in enumerate(experiments) if number not in held)
        unseen = tuple(experiments[number] for number in sorted(held))
    else:
        cuts = [len(one.y) - max(_FEWEST, len(one.y) // _SHARE) for one in experiments]
        seen = tuple(_part(one, 0, max(cut, 0)) for one, cut in zip(experiments, cuts, strict=True))
        unseen = tuple(_part(one, max(cut - overlap, 0), None) for one, cut in zip(experiments, cuts, strict=True))
    return Split(seen=replace(history, experiments=seen), unseen=replace(history, experiments=unseen), overlap=overlap)


def stretches(history: History) -> Iterator[Experiment]:
    """The longest parts of the experiments without a missing u, y or x: an observer starts anew after a gap."""
    for one in history.experiments:
        whole = np.isfinite(one.u).all(axis=1) & np.isfinite(one.y).all(axis=1) & np.isfinite(one.x).all(axis=1)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], whole, [False]]).astype(int)))
        for start, stop in zip(edges[::2], edges[1::2], strict=True):
            yield _part(one, int(start), int(stop))


def leverage(seen: NDArray[np.float64], unseen: NDArray[np.float64], rank: int) -> float:
    """How far unseen columns (k, N') go beyond seen ones (k, N), largest |S^+ s|: what a fit is off by grows with it.

    Args:
        seen: trajectories, a column each.
        unseen: likewise.
        rank: directions that the seen ones span but for rounding or noise.
    """
    left, values, _ = np.linalg.svd(seen, full_matrices=False)
    rank = min(rank, int(np.count_nonzero(values)))
    shares = (left[:, :rank] / values[:rank]).T @ unseen
    return float(np.max(np.linalg.norm(shares, axis=0), initial=0.0))


def rounding(tolerance: float, gain: float, trials: Sequence[Trial], beyond: float = 0.0) -> Allowance:
    """What rounding of the recorded samples allows an exact design: a share of the signals times the gain on them.

    Args:
        tolerance: rounding of the samples and of what follows from them, in shares of the spread.
        gain: how much larger than the received signals the observer's answer can be.
        trials: on unseen samples, scaled: larger signals carry larger rounding.
        beyond: leverage of the unseen samples.
    """
    size = max((trial.size for trial in trials), default=1.0)
    allowed = min(_EXACT, _LOST * max(tolerance, np.finfo(float).eps * size) * (1.0 + gain) * (1.0 + beyond))
    return Allowance(error=float(allowed), residual=float(allowed), basis=_BY_ROUNDING)


def noise(seen: Sequence[Trial], unknowns: int, exact: Allowance, stated: Allowance | None = None) -> Allowance:
    """What noise allows: six standard deviations of what the seen samples show, three times their peak, or as stated.

    Args:
        seen: trials on the samples that the design fitted, scaled.
        unknowns: degrees of freedom that the fit used up.
        exact: what rounding allows anyway.
        stated: standard deviations that the stated noise causes.
    """
    if not seen:
        return exact
    error, residual = (np.vstack([getattr(one, name) for one in seen]) for name in ("error", "residual"))
    widened = SIGMAS * np.sqrt(len(residual) / max(len(residual) - unknowns, 1))
    levels = [
        np.maximum(widened * np.sqrt(np.mean(table**2, axis=0)), _PEAKS * np.max(np.abs(table), axis=0, initial=0.0))
        for table in (error, residual)
    ]
    basis = "the noise on the samples seen"
    if stated is not None:
        levels = [np.maximum(levels[0], SIGMAS * stated.error), np.maximum(levels[1], SIGMAS * stated.residual)]
        basis = f"{basis} or {stated.basis}"
    error, residual = (
        np.minimum(np.maximum(level, least), most)
        for level, least, most in zip(levels, (exact.error, exact.residual), (_USELESS, _WORTHLESS), strict=True)
    )
    return Allowance(error=error, residual=residual, basis=basis)


def of_their_size(trials: Sequence[Trial]) -> list[Trial]:
    """Errors and residuals in shares of signals that have died out: rounding is relative, and so is what it leaves."""
    sizes = [min(1.0, max(one.size, float(np.finfo(float).tiny))) for one in trials]
    return [
        replace(one, error=one.error / size, residual=one.residual / size)
        for one, size in zip(trials, sizes, strict=True)
    ]


def prove(
    unseen: Sequence[Trial],
    allowance: Allowance,
    scales: tuple[NDArray[np.float64], NDArray[np.float64]],
    *,
    spare_columns: int,
    estimate: str = "estimate",
    hardly: float = 0.0,
) -> Proof:
    """Hold what came out on unseen samples against what is allowed.

    Args:
        unseen: trials in scaled units.
        allowance: in scaled units.
        scales: of the estimated signals (k,) and of the outputs (p,): user's units in one scaled unit.
        spare_columns: see Proof.
        estimate: what is estimated, a word.
        hardly: see Proof, whatever is allowed.
    """
    k, p = len(scales[0]), len(scales[1])
    errors = _worst([trial.error for trial in unseen], k)
    residuals = _worst([trial.residual for trial in unseen], p)
    samples = sum(len(trial.residual) if p else len(trial.error) for trial in unseen)
    worst_error, allowed_error = _closest(errors, allowance.error)
    worst_residual, allowed_residual = _closest(residuals, allowance.residual)
    told = 1.0 if allowance.basis == _BY_ROUNDING else _HARDLY
    below = bool(np.all(errors <= allowance.error) and np.all(residuals <= allowance.residual))
    return Proof(
        samples=samples,
        spare_columns=spare_columns,
        estimate=estimate,
        worst_error=worst_error,
        worst_residual=worst_residual,
        allowed_error=allowed_error,
        allowed_residual=allowed_residual,
        errors=errors * scales[0],
        residuals=residuals * scales[1],
        basis=allowance.basis,
        holds=bool(samples) and below,
        close=_close(allowance, errors, residuals),
        hardly=hardly if hardly > told * (allowed_error or 0.0) else 0.0,
    )


def _close(allowance: Allowance, errors: NDArray[np.float64], residuals: NDArray[np.float64]) -> bool:
    """Whether the figure closest to what is allowed is near it: a decade for rounding, else a factor of 2."""
    pairs = ((errors, allowance.error), (residuals, allowance.residual))
    shares = [np.max(found / np.maximum(most, np.finfo(float).tiny), initial=0.0) for found, most in pairs]
    share = float(max(shares))
    return 1.0 / _NEAR < share <= _NEAR if allowance.basis == _BY_ROUNDING else 1.0 < share <= _NEAR_NOISE


def _part(one: Experiment, start: int, stop: int | None) -> Experiment:
    return replace(one, **{name: getattr(one, name)[start:stop] for name in ("u", "y", "x", "d", "w")})


def _worst(tables: Sequence[NDArray[np.float64]], columns: int) -> NDArray[np.float64]:
    """Largest modulus in each column; NaN, which no bound allows, where a run overflowed."""
    return np.asarray(np.max(np.abs(np.vstack([np.zeros((1, columns)), *tables])), axis=0, initial=0.0))


def _closest(worst: NDArray[np.float64], allowed: NDArray[np.float64] | float) -> tuple[float | None, float | None]:
    """Worst value and allowance of the signal that comes closest to what it is allowed."""
    if not worst.size:
        return None, None
    limits = np.broadcast_to(np.asarray(allowed, dtype=np.float64), worst.shape)
    at = int(np.argmax(np.where(np.isnan(worst), np.inf, worst / np.maximum(limits, np.finfo(float).tiny))))
    return float(worst[at]), float(limits[at])
