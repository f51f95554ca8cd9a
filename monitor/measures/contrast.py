"""Does something happen more often with a cause than without it, and how many trials would tell?"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

LIMIT = 0.025  # of the p-value: one-sided, as the ends of 95 % intervals
POWER = 0.9
TRIALS = (5, 6, 8, 10, 12, 15, 20, 30, 40, 50, 75, 100, 150, 200, 300, 500, 1000)
"""Numbers of trials that are worth proposing."""


def more_often(hits: int, by_chance: int, trials: int) -> float:
    """p-value of Fisher's exact test, one-sided: so many hits or more in as many trials each, if there is no effect."""
    return float(_tails(trials, hits + by_chance)[hits])


def trials_needed(hits: int, by_chance: int, trials: int) -> int | None:
    """Fewest of TRIALS that show the effect with probability POWER, were its size as found; None: more than those.

    The shares found are shrunk towards one half, (hits + 1/2) / (trials + 1): few trials exaggerate.
    """
    share, chance = ((found + 0.5) / (trials + 1.0) for found in (hits, by_chance))
    if share <= chance:
        return None
    return next((count for count in TRIALS if count > trials and _power(count, share, chance) >= POWER), None)


def _power(trials: int, share: float, chance: float) -> float:
    """Probability that `trials` trials with and as many without are significant."""
    with_cause, without = (_binomial(trials, one) for one in (share, chance))
    found = 0.0
    for total in range(1, 2 * trials + 1):
        least, most = max(total - trials, 0), min(total, trials)
        hits = np.arange(least, most + 1)
        significant = _tails(trials, total)[hits] < LIMIT
        found += float((with_cause[hits] * without[total - hits])[significant].sum())
    return found


def _tails(trials: int, total: int) -> NDArray[np.float64]:
    """P(as many hits or more among the first `trials` of 2 `trials`, given `total` hits), for 0 ... `trials` hits."""
    hits = np.arange(trials + 1)
    others = total - hits
    possible = (others >= 0) & (others <= trials)
    logs = np.where(possible, _choose(trials, hits) + _choose(trials, np.clip(others, 0, trials)), -np.inf)
    weights = np.exp(logs - logs.max())
    return np.asarray(np.minimum(np.cumsum(weights[::-1])[::-1] / weights.sum(), 1.0))


def _binomial(trials: int, share: float) -> NDArray[np.float64]:
    hits = np.arange(trials + 1)
    return np.asarray(np.exp(_choose(trials, hits) + hits * np.log(share) + (trials - hits) * np.log1p(-share)))


def _choose(trials: int, hits: NDArray[np.int64]) -> NDArray[np.float64]:
    """Logarithm of the binomial coefficient."""
    from scipy.special import gammaln  # noqa: PLC0415 (takes its time)

    return np.asarray(gammaln(trials + 1.0) - gammaln(hits + 1.0) - gammaln(trials - hits + 1.0))
