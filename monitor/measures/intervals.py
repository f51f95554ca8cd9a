"""Estimates with confidence intervals; every interval says by which method."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, nan
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

RESAMPLES = 1000
_FEWEST_BLOCKS = 10  # a bootstrap of fewer says nothing


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """A confidence interval.

    Attributes:
        low: its lower end.
        high: its upper end.
        level: confidence, as 0.95.
        method: how it was computed and what it assumes, a few words.
    """

    low: float
    high: float
    level: float
    method: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """An estimated number.

    Attributes:
        value: NaN when there is nothing to estimate it from.
        interval: None when there is no honest one.
    """

    value: float
    interval: Interval | None = None


def clopper_pearson(successes: int, trials: int, level: float = 0.95) -> Measured:
    """Share of successes, exact for independent trials."""
    from scipy.special import betaincinv  # noqa: PLC0415 (takes its time, and few who import this measure intervals)

    if not trials:
        return Measured(value=nan)
    tail, missed = (1.0 - level) / 2.0, trials - successes
    low = float(betaincinv(successes, missed + 1, tail)) if successes else 0.0
    high = float(betaincinv(successes + 1, missed, 1.0 - tail)) if missed else 1.0
    interval = Interval(low=low, high=high, level=level, method="Clopper-Pearson")
    return Measured(value=successes / trials, interval=interval)


def median(values: NDArray[np.float64], level: float = 0.95) -> Measured:
    """Median with the interval between two order statistics, exact for independent values of any distribution.

    P(x_(k) <= median <= x_(n+1-k)) = 1 - 2 P(B < k), B ~ binomial(n, 1/2): six values are the fewest with 0.95.
    """
    from scipy.special import bdtr  # noqa: PLC0415 (idem)

    ordered = np.sort(values)
    count = len(ordered)
    if not count:
        return Measured(value=nan)
    outside = 2.0 * bdtr(np.arange(count // 2, dtype=np.float64), count, 0.5)  # for k = 1, 2, ...
    kept = int(np.count_nonzero(outside <= 1.0 - level))
    value = float(np.median(ordered))
    if not kept:
        return Measured(value=value)
    low, high = float(ordered[kept - 1]), float(ordered[count - kept])
    return Measured(value=value, interval=Interval(low=low, high=high, level=level, method="order statistics"))


def mean_time_between(events: int, time_sec: float, level: float = 0.95) -> Measured:
    """Mean time between events of a Poisson process watched for some time; infinite when there were none.

    Garwood's exact interval: 2 T / chi2(1 - a/2, 2 k + 2) to 2 T / chi2(a/2, 2 k); with k = 0 it has a lower end only,
    which the whole of a goes to.
    """
    from scipy.special import chdtri  # noqa: PLC0415 (idem)

    if time_sec <= 0.0:
        return Measured(value=nan)
    tail = (1.0 - level) / 2.0 if events else 1.0 - level
    # chdtri(k, q) is the chi-squared quantile of 1 - q with k degrees of freedom
    low = 2.0 * time_sec / float(chdtri(2 * events + 2, tail))
    high = 2.0 * time_sec / float(chdtri(2 * events, 1.0 - tail)) if events else inf
    method = "Garwood, Poisson" if events else "Garwood, Poisson, one-sided"
    interval = Interval(low=low, high=high, level=level, method=method)
    return Measured(value=time_sec / events if events else inf, interval=interval)


def block_sums(values: NDArray[np.generic], length: int) -> NDArray[np.float64]:
    """Sums over consecutive blocks of so many steps; the last one may be shorter.

    Args:
        values: (steps, ...).
        length: steps of a block.
    """
    starts = np.arange(0, len(values), max(length, 1))
    if not len(starts):
        return np.zeros((0, *values.shape[1:]))
    return np.asarray(np.add.reduceat(values.astype(np.float64), starts, axis=0))


def block_bootstrap(
    numerator: NDArray[np.float64],
    denominator: NDArray[np.float64],
    *,
    seed: int,
    level: float = 0.95,
    resamples: int = RESAMPLES,
) -> Measured:
    """Ratio sum(numerator) / sum(denominator) over blocks of a correlated series.

    Whole blocks are drawn anew (Carlstein 1986): valid when what happens in one block hardly depends on the others.

    Args:
        numerator: (blocks,).
        denominator: (blocks,), blocks with 0 do not count.
        seed: of the draws.
        level: confidence.
        resamples: how many.
    """
    counted = denominator > 0
    above, below = numerator[counted], denominator[counted]
    if not len(below):
        return Measured(value=nan)
    value = float(above.sum() / below.sum())
    if len(below) < _FEWEST_BLOCKS:
        return Measured(value=value)
    weights = resample_weights(len(below), resamples, seed)
    ratios = (weights @ above) / (weights @ below)
    low, high = np.quantile(ratios, [(1.0 - level) / 2.0, (1.0 + level) / 2.0])
    method = f"block bootstrap, {len(below)} blocks"
    return Measured(value=value, interval=Interval(low=float(low), high=float(high), level=level, method=method))


def resample_weights(blocks: int, resamples: int, seed: int) -> NDArray[np.float64]:
    """How often each block is drawn, (resamples, blocks)."""
    draw = np.random.default_rng(seed)
    return draw.multinomial(blocks, np.full(blocks, 1.0 / blocks), size=resamples).astype(np.float64)
