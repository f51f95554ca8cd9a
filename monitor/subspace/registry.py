"""The methods by name."""

from __future__ import annotations

from dataclasses import replace
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from monitor.behaviour import Behaviour, identify_output
from monitor.errors import HistoryError
from monitor.subspace.directly_driven import directly_driven
from monitor.subspace.regression import regression
from monitor.subspace.structured import structured
from monitor.subspace.total_least_squares import total_least_squares
from monitor.subspace.truncation import truncation

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from monitor.history import DataMatrices
    from monitor.output_map import OutputMap

_ROUNDING = 1e-9  # relative: how wrong a direction of exact data may be


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


def span(
    data: DataMatrices,
    unknown_inputs: int,
    method: Method,
    weights: NDArray[np.float64],
    *,
    output: OutputMap | None = None,
    tolerance: float = _ROUNDING,
) -> Behaviour:
    """Find the behaviour of rank 2m + n + m_d; weights (n,) are 1 / noise_std of the states, up to a factor.

    Args:
        data: the history.
        unknown_inputs: m_d.
        method: how noisy data are fitted.
        weights: see above.
        output: the output map when it is known already; unknown inputs that act on y directly ask for exact data.
        tolerance: how far a direction may be wrong, relative.

    Raises:
        HistoryError: too few columns for that rank, or y is no function of x.
    """
    rank = 2 * len(data.U_p) + len(data.X_p) + unknown_inputs
    if data.columns < rank:
        raise HistoryError(f"the history has {data.columns} usable columns, expected at least {rank}: record longer")
    if output is not None and output.driven.any():
        return directly_driven(data, unknown_inputs, output, tolerance)
    C, D = (identify_output(data), None) if output is None else (output.C, output.D)
    blocks = METHODS[method](data, unknown_inputs, weights)
    basis, _ = np.linalg.qr(np.vstack(blocks))
    L_u, L_x, L_uf, L_xf = np.split(basis, np.cumsum([len(block) for block in blocks[:-1]]))
    found = Behaviour(L_u=L_u, L_x=L_x, L_uf=L_uf, L_xf=L_xf, C=C, unknown_inputs=unknown_inputs)
    if output is None or D is None:
        return found
    return replace(found, D=D, C_error=output.error(data.columns))
