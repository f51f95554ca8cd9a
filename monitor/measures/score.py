"""How close a residual is to an alarm."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def score(residual: NDArray[np.float64], threshold: NDArray[np.float64]) -> NDArray[np.float64]:
    """max_i |r_i| / rbar_i: above 1 a detector that compares each component with its threshold alarms.

    Args:
        residual: (..., p), NaN where there is none.
        threshold: (..., p), NaN before it is set.

    Returns:
        (...), NaN where no component has both.
    """
    magnitude = np.abs(residual)
    ratio = np.divide(magnitude, threshold, out=np.full(magnitude.shape, np.nan), where=threshold > 0.0)
    return np.asarray(np.fmax.reduce(ratio, axis=-1))
