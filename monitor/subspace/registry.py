"""The methods by name."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from monitor.behaviour import Behaviour, identify_output
from monitor.errors import HistoryError
from monitor.subspace.regression import regression
from monitor.subspace.structured import structured
from monitor.subspace.total_least_squares import total_least_squares
from monitor.subspace.truncation import truncation

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from monitor.history import DataMatrices


class Method(Enum):
    """How the behaviour is found once the rank is decided; on exact data all agree."""

    TRUNCATION = "truncation"
    REGRESSION = "regression"
    TOTAL_LEAST_SQUARES = "total_least_squares"
    STRUCTURED = "structured"


METHODS: dict[Method, Callable[[DataMatrices, int, NDArray[np.float64]], tuple[NDArray[np.float64], ...]]] = {
    Method.TRUNCATION: truncation,
    Method.REGRESSION: regression,
    Method.TOTAL_LEAST_SQUARES: total_least_squares,
    Method.STRUCTURED: structured,
}


def span(data: DataMatrices, unknown_inputs: int, method: Method, weights: NDArray[np.float64]) -> Behaviour:
    """Find the behaviour of rank 2m + n + m_d; weights (n,) are 1 / noise_std of the states, up to a factor.

    Raises:
        HistoryError: too few columns for that rank, or y is no function of x.
    """
    rank = 2 * len(data.U_p) + len(data.X_p) + unknown_inputs
    if data.columns < rank:
        raise HistoryError(f"the history has {data.columns} usable columns, expected at least {rank}: record longer")
    C = identify_output(data)
    blocks = METHODS[method](data, unknown_inputs, weights)
    basis, _ = np.linalg.qr(np.vstack(blocks))
    L_u, L_x, L_uf, L_xf = np.split(basis, np.cumsum([len(block) for block in blocks[:-1]]))
    return Behaviour(L_u=L_u, L_x=L_x, L_uf=L_uf, L_xf=L_xf, C=C, unknown_inputs=unknown_inputs)
