"""What any threshold would have bought: the receiver operating characteristic of a score."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan
from typing import TYPE_CHECKING

import numpy as np
from sklearn.metrics import auc, roc_curve  # type: ignore[import-untyped]

from monitor.measures.intervals import RESAMPLES, Estimate, Interval, resample_weights

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOST_POINTS = 300
_BINS = 512  # of the scores in the bootstrap: ties within one count half
_FEWEST_BLOCKS = 10
_LARGEST = 1e30  # stands for an infinite score, which curves cannot carry


@dataclass(frozen=True, slots=True, kw_only=True)
class Roc:
    """A ROC curve.

    Attributes:
        false_positive_rate: (points,) share of quiet samples above the limit.
        true_positive_rate: (points,) share of attacked samples above it.
        limit: (points,) on the score, descending.
        area: area under the curve, 0.5 for a coin.
    """

    false_positive_rate: NDArray[np.float64]
    true_positive_rate: NDArray[np.float64]
    limit: NDArray[np.float64]
    area: Estimate


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
    known = np.where(np.isnan(scores), 0.0, np.minimum(scores, _LARGEST))
    if not attacked.any() or not quiet.any():
        return None
    labels = np.concatenate([np.ones(np.count_nonzero(attacked)), np.zeros(np.count_nonzero(quiet))])
    rates = roc_curve(labels, np.concatenate([known[attacked], known[quiet]]))
    false, true, limit = (np.asarray(one, dtype=np.float64) for one in rates)
    rows = np.unique(np.linspace(0, len(false) - 1, min(len(false), MOST_POINTS)).round().astype(np.intp))
    area = float(auc(false, true))
    areas = _resampled_areas(known, attacked, quiet, block_steps, seed)
    return Roc(
        false_positive_rate=false[rows],
        true_positive_rate=true[rows],
        limit=limit[rows],
        area=Estimate(value=area, interval=_interval(areas, level)),
    )


def _interval(areas: NDArray[np.float64], level: float) -> Interval | None:
    if not len(areas):
        return None
    low, high = np.quantile(areas, [(1.0 - level) / 2.0, (1.0 + level) / 2.0])
    return Interval(low=float(low), high=float(high), level=level, method="block bootstrap")


def _resampled_areas(
    scores: NDArray[np.float64] | NDArray[np.float32],
    attacked: NDArray[np.bool_],
    quiet: NDArray[np.bool_],
    block_steps: int,
    seed: int,
) -> NDArray[np.float64]:
    """Areas with blocks of attacked and of quiet time drawn anew, each among themselves; none of too few blocks."""
    edges = np.unique(np.quantile(scores[attacked | quiet], np.linspace(0.0, 1.0, _BINS + 1)[1:-1]))
    places = np.searchsorted(edges, scores, side="left")
    block = np.broadcast_to((np.arange(len(scores)) // max(block_steps, 1))[:, None], scores.shape)
    positive = _histograms(places[attacked], block[attacked], len(edges) + 1)
    negative = _histograms(places[quiet], block[quiet], len(edges) + 1)
    if min(len(positive), len(negative)) < _FEWEST_BLOCKS:
        return np.empty(0)
    drawn = [
        resample_weights(len(one), RESAMPLES, seed + number) @ one for number, one in enumerate((positive, negative))
    ]
    return _areas(*drawn)


def _histograms(places: NDArray[np.intp], block: NDArray[np.intp], bins: int) -> NDArray[np.float64]:
    """(blocks with samples, bins) counts."""
    _, rows = np.unique(block, return_inverse=True)
    count = int(rows.max(initial=-1)) + 1
    return np.bincount(rows * bins + places, minlength=count * bins).reshape(count, bins).astype(np.float64)


def _areas(positive: NDArray[np.float64], negative: NDArray[np.float64]) -> NDArray[np.float64]:
    """P(score of an attacked sample > of a quiet one) + half of P(equal), each row (bins,) of counts."""
    below = np.cumsum(negative, axis=1) - negative
    pairs = positive.sum(axis=1) * negative.sum(axis=1)
    wins: NDArray[np.float64] = (positive * (below + 0.5 * negative)).sum(axis=1)
    return np.asarray(np.divide(wins, pairs, out=np.full(len(wins), nan), where=pairs > 0.0))
