"""The trajectories that the windows span once their rank is decided: noise-free for exact data, truncated else."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from monitor.input_reconstruction.windows import Windows

_KNOWN_GAP = 3.0  # a gap at a place that is known only has to be confirmed
_SEARCHED_GAP = 10.0  # a gap that has to be found must stand out clearly
_ROUNDED = 1e2  # times what double precision leaves: a direction that shows more is no rounding
_EXACT = 1e-9  # relative: below it exact data carry rounding only


class RankBasis(Enum):
    """What the rank of the windows rests on."""

    EXACT = "exact"
    ORDER = "known order"
    GAP = "singular-value gap"
    LEAST_SQUARES = "not decided: least squares on all directions"


@dataclass(frozen=True, slots=True, kw_only=True)
class Behaviour:
    """Windows restricted to the plant's own trajectories; every column is one of them, all matrices share columns.

    Attributes:
        H: (past m + L p, r) past inputs and all outputs.
        u_now: (m, r) the input at t.
        H_past: (past m + past p, s) past inputs and past outputs alone, another basis.
        basis: what the rank rests on.
        order: order of the plant as the past windows show it, None when the rank is not decided.
        noise: singular value of the first direction dropped, relative to the last one kept; 0 for exact data.
        hidden: the same relative to the largest, of exact data, where it is more than double precision leaves; else 0.
    """

    H: NDArray[np.float64]
    u_now: NDArray[np.float64]
    H_past: NDArray[np.float64]
    basis: RankBasis
    order: int | None
    noise: float
    hidden: float = 0.0

    @property
    def decided(self) -> bool:
        """Whether the columns are trajectories of the plant and not a mixture with noise."""
        return self.order is not None

    @property
    def rank(self) -> int:
        """Rank of [U_p; u_t; Y]."""
        return int(self.H.shape[1])


def truncate(windows: Windows, order: int | None, tolerance: float) -> Behaviour:
    """Decide the ranks of [U_p; Y_p] and of [U_p; u_t; Y] and keep as many directions (total least squares).

    rank [U_p; Y_p] = past m + order; rank [U_p; u_t; Y] = past m + order + v, where v counts the inputs from t on
    that the outputs up to t + future - 1 show (m <= v <= future m when the input at t can be reconstructed).

    Args:
        windows: the recorded windows.
        order: order of the plant, if it is known.
        tolerance: what counts as rounding, relative to the largest singular value.
    """
    m, known = windows.inputs, windows.past * windows.inputs
    past_basis, past_values = _directions(np.vstack([windows.U_past, windows.Y_past]))
    basis, values = _directions(np.vstack([windows.U_past, windows.u_now, windows.Y]))
    orders = [order] if order is not None else range(1, len(past_values) - known)
    past_rank, _, rests_on = _decide(past_values, [known + one for one in orders], order, tolerance)
    found = None if past_rank is None else past_rank - known
    visible = [known + (found or 0) + count for count in range(1, windows.future * m + 1)]
    rank, noise, _ = _decide(values, visible, found, tolerance)
    if found is None or past_rank is None or rank is None:
        return untruncated(windows)
    kept = basis[:, :rank]
    return Behaviour(
        H=np.vstack([kept[:known], kept[known + m :]]),
        u_now=kept[known : known + m],
        H_past=past_basis[:, :past_rank],
        basis=rests_on,
        order=found,
        noise=noise,
        hidden=max(_hidden(past_values, past_rank), _hidden(values, rank)) if rests_on is RankBasis.EXACT else 0.0,
    )


def _hidden(values: NDArray[np.float64], rank: int) -> float:
    """First dropped value relative to the largest; 0 where rounding explains it."""
    share = float(values[rank] / values[0]) if rank < len(values) else 0.0
    return share if share > _ROUNDED * np.finfo(float).eps else 0.0


def untruncated(windows: Windows) -> Behaviour:
    """Take every window as it is; what follows is least squares on noisy data."""
    return Behaviour(
        H=windows.H,
        u_now=windows.u_now,
        H_past=np.vstack([windows.U_past, windows.Y_past]),
        basis=RankBasis.LEAST_SQUARES,
        order=None,
        noise=1.0,
    )


def shows_order(stacked: NDArray[np.float64], rank: int, tolerance: float) -> bool:
    """Whether [U; Y] of some windows has this rank: exactly, by a gap at this place, or because it has no more rows."""
    values = np.linalg.svd(stacked, compute_uv=False)
    if not 0 < rank < len(values):
        return rank == len(values)
    exact = int(np.count_nonzero(values > tolerance * values[0]))
    return exact == rank if exact < len(values) else bool(values[rank - 1] >= _KNOWN_GAP * values[rank])


def _directions(stacked: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    directions, values, _ = np.linalg.svd(stacked, full_matrices=False)
    return directions, values


def _decide(
    values: NDArray[np.float64], candidates: Sequence[int], known: int | None, tolerance: float
) -> tuple[int | None, float, RankBasis]:
    """Rank, first dropped over last kept singular value, and what it rests on; no rank when no gap is clear."""
    exact = int(np.count_nonzero(values > tolerance * values[0]))
    if exact < len(values):
        return exact, 0.0, RankBasis.EXACT
    possible = [rank for rank in candidates if 0 < rank < len(values)]
    if not possible:
        return (len(values), 0.0, RankBasis.EXACT) if len(values) in candidates else (None, 1.0, RankBasis.GAP)
    gaps = [float(values[rank - 1] / values[rank]) for rank in possible]
    best = int(np.argmax(gaps))
    needed = _SEARCHED_GAP if known is None else _KNOWN_GAP
    if gaps[best] < needed:
        return None, 1.0, RankBasis.GAP
    return possible[best], 1.0 / gaps[best], RankBasis.GAP if known is None else RankBasis.ORDER
