"""The null space of a matrix, without scipy: importing its linear algebra takes as long as a whole short run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["null_space"]


def null_space(A: NDArray[np.float64], rcond: float | None = None) -> NDArray[np.float64]:
    """Orthonormal basis (n, n - rank) of ker A, by the right singular vectors whose values count as zero.

    Args:
        A: (m, n).
        rcond: singular values up to this share of the largest count as zero, None: the larger side times rounding.
    """
    share = float(np.finfo(np.float64).eps) * max(A.shape) if rcond is None else rcond
    _, values, vh = np.linalg.svd(A, full_matrices=True)
    rank = int(np.sum(values > share * np.max(values, initial=0.0)))
    basis: NDArray[np.float64] = vh[rank:].T
    return basis
