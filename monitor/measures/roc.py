"""What any threshold would have bought: the receiver operating characteristic of a score."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan
from typing import TYPE_CHECKING

import numpy as np

from monitor.measures.intervals import RESAMPLES, Interval, Measured, resample_weights

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOST_POINTS = 300
_FEWEST_BLOCKS = 10
_LARGEST = 1e30  # stands for an infinite score, which curves cannot carry


@dataclass(frozen=True, slots=True, kw_only=True)
class Roc:
    """A ROC curve.

    Attributes:
        false_positive_rate: (points,) share of quiet samples at or above the limit.
        true_positive_rate: (points,) share of attacked samples there.
        limit: (points,) on the score, an alarm from it on; descending from infinity to minus infinity.
        area: area under the curve, 0.5 for a coin.
    """

    false_positive_rate: NDArray[np.float64]
    true_positive_rate: NDArray[np.float64]
    limit: NDArray[np.float64]
    area: Measured


def roc(
    scores: NDArray[np.float64] | NDArray[np.float32],
    attacked: NDArray[np.bool_],
    quiet: NDArray[np.bool_],
    *,
    block_steps: int,
    seed: int,
    level: float = 0.95,
) -> Roc | None:
    """Curve over (steps, links); an attacked sample without a score (lost, not armed) is one that shows nothing.

    Args:
        scores: (steps, links), larger where an attack is more likely, at least 0; NaN where there is none.
        attacked: (steps, links).
        quiet: (steps, links); samples that are neither do not count.
        block_steps: steps that are drawn together for the interval of the area.
        seed: of the bootstrap.
        level: confidence.

    Returns:
        None unless there are samples of both kinds.
    """
    quiet = quiet & ~np.isnan(scores)
    known = np.nan_to_num(np.minimum(scores, scores.dtype.type(_LARGEST)), copy=False)
    if not attacked.any() or not quiet.any():
        return None
    positive, negative = np.sort(known[attacked]), np.sort(known[quiet])
    limit = np.concatenate([[np.inf], _some(positive, negative), [-np.inf]])
    areas = _resampled_areas(known, attacked, quiet, limit[-2:0:-1], block_steps=block_steps, seed=seed)
    return Roc(
        false_positive_rate=1.0 - np.searchsorted(negative, limit) / len(negative),
        true_positive_rate=1.0 - np.searchsorted(positive, limit) / len(positive),
        limit=limit,
        area=Measured(value=_area(positive, negative), interval=_interval(areas, level)),
    )


def _some(*sorted_scores: NDArray[np.float64] | NDArray[np.float32]) -> NDArray[np.float64]:
    """Limits at which the curve bends, or some of them evenly over the samples of both kinds, descending."""
    count = MOST_POINTS // len(sorted_scores)
    taken = [one[np.linspace(0, len(one) - 1, min(len(one), count)).round().astype(np.intp)] for one in sorted_scores]
    return np.unique(np.concatenate(taken).astype(np.float64))[::-1]


def _area(
    positive: NDArray[np.float64] | NDArray[np.float32], negative: NDArray[np.float64] | NDArray[np.float32]
) -> float:
    """P(positive > negative) + P(equal) / 2 over all pairs of sorted scores: Mann and Whitney's."""
    below = np.searchsorted(negative, positive, side="left").sum(dtype=np.float64)
    up_to = np.searchsorted(negative, positive, side="right").sum(dtype=np.float64)
    return float((below + up_to) / (2.0 * len(positive) * len(negative)))


def _interval(areas: NDArray[np.float64], level: float) -> Interval | None:
    if not len(areas):
        return None
    low, high = np.quantile(areas, [(1.0 - level) / 2.0, (1.0 + level) / 2.0])
    return Interval(low=float(low), high=float(high), level=level, method="block bootstrap")


def _resampled_areas(
    scores: NDArray[np.float64] | NDArray[np.float32],
    attacked: NDArray[np.bool_],
    quiet: NDArray[np.bool_],
    edges: NDArray[np.float64],
    *,
    block_steps: int,
    seed: int,
) -> NDArray[np.float64]:
    """Areas with blocks of attacked and of quiet time drawn anew, each among themselves; none of too few blocks.

    Scores are counted between edges: there may be millions, and ties within one bin count half.
    """
    positive, negative = (_histograms(scores, among, edges, block_steps) for among in (attacked, quiet))
    if min(len(positive), len(negative)) < _FEWEST_BLOCKS:
        return np.empty(0)
    drawn = [
        resample_weights(len(one), RESAMPLES, seed + number) @ one for number, one in enumerate((positive, negative))
    ]
    return _areas(*drawn)


def _histograms(
    scores: NDArray[np.float64] | NDArray[np.float32],
    among: NDArray[np.bool_],
    edges: NDArray[np.float64],
    block_steps: int,
) -> NDArray[np.float64]:
    """(blocks with samples, bins) counts."""
    starts = range(0, len(scores), max(block_steps, 1))
    blocks = [slice(start, start + max(block_steps, 1)) for start in starts]
    rows = [
        np.bincount(np.searchsorted(edges, scores[block][among[block]], side="right"), minlength=len(edges) + 1)
        for block in blocks
        if among[block].any()
    ]
    return np.array(rows, dtype=np.float64)


def _areas(positive: NDArray[np.float64], negative: NDArray[np.float64]) -> NDArray[np.float64]:
    """P(score of an attacked sample > of a quiet one) + half of P(equal), each row (bins,) of counts."""
    below = np.cumsum(negative, axis=1) - negative
    pairs = positive.sum(axis=1) * negative.sum(axis=1)
    wins: NDArray[np.float64] = (positive * (below + 0.5 * negative)).sum(axis=1)
    return np.asarray(np.divide(wins, pairs, out=np.full(len(wins), nan), where=pairs > 0.0))
