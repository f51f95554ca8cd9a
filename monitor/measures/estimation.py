"""Errors of state estimates against the truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from monitor.measures.intervals import block_bootstrap

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from monitor.measures.intervals import Measured


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorSums:
    """Sums of errors over blocks of time.

    Attributes:
        count: (blocks, n) estimates.
        absolute: (blocks, n) sum of |e|.
        squared: (blocks, n) sum of e^2.
    """

    count: NDArray[np.float64]
    absolute: NDArray[np.float64]
    squared: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimateErrors:
    """Mean errors of each component of an estimate.

    Attributes:
        samples: estimates that were compared.
        mse: mean of e^2 of each component, squared units.
        mae: mean of |e| of each component.
    """

    samples: int
    mse: tuple[Measured, ...]
    mae: tuple[Measured, ...]


def estimate_errors(sums: ErrorSums, *, seed: int, level: float = 0.95) -> EstimateErrors:
    """MSE and MAE with intervals by blocks."""

    def means(of: NDArray[np.float64]) -> tuple[Measured, ...]:
        columns = zip(of.T, sums.count.T, strict=True)
        return tuple(block_bootstrap(above, below, seed=seed, level=level) for above, below in columns)

    samples = int(sums.count.sum(axis=0).max(initial=0.0))
    return EstimateErrors(samples=samples, mse=means(sums.squared), mae=means(sums.absolute))
