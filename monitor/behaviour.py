"""The subspace of all one-step trajectories (u_t, x_t, u_t+1, x_t+1) that the history spans."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from monitor.errors import HistoryError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.history import DataMatrices

_ROUNDING = 1e-9  # relative misfit of y = C x that exact data may show
_SELECTION = 1e-2  # entries of C this close to 0 and 1 are a selection of states


@dataclass(frozen=True, slots=True, kw_only=True)
class Behaviour:
    """What the data say once the rank is decided; every column of L is a one-step trajectory of the plant.

    Attributes:
        L_u: (m, r) known inputs at t, r = 2m + n + m_d.
        L_x: (n, r) states at t.
        L_uf: (m, r) known inputs at t + 1.
        L_xf: (n, r) states at t + 1.
        C: (p, n) output map, y = C x.
        unknown_inputs: m_d.
    """

    L_u: NDArray[np.float64]
    L_x: NDArray[np.float64]
    L_uf: NDArray[np.float64]
    L_xf: NDArray[np.float64]
    C: NDArray[np.float64]
    unknown_inputs: int

    @property
    def stacked(self) -> NDArray[np.float64]:
        """[U_p; Y_p; X_p; U_f; Y_f] of T (13) on the trajectories of the basis."""
        return np.vstack([self.L_u, self.C @ self.L_x, self.L_x, self.L_uf, self.C @ self.L_xf])

    def in_units(self, u: NDArray[np.float64], y: NDArray[np.float64], x: NDArray[np.float64]) -> Behaviour:
        """The same behaviour with every signal multiplied by its factor; the basis stays orthonormal."""
        blocks = (u[:, None] * self.L_u, x[:, None] * self.L_x, u[:, None] * self.L_uf, x[:, None] * self.L_xf)
        basis, _ = np.linalg.qr(np.vstack(blocks))
        L_u, L_x, L_uf, L_xf = np.split(basis, np.cumsum([len(block) for block in blocks[:-1]]))
        C = y[:, None] * self.C / x
        return replace(self, L_u=L_u, L_x=L_x, L_uf=L_uf, L_xf=L_xf, C=C)


def identify_output(data: DataMatrices) -> NDArray[np.float64]:
    """Find C = Y X^+ (reduced-order UIO paper, below (10)).

    Raises:
        HistoryError: y is no static function of x, or carries the states in another order.
    """
    X, Y = np.hstack([data.X_p, data.X_f]), np.hstack([data.Y_p, data.Y_f])
    C = Y @ np.linalg.pinv(X)
    rounded = np.round(C)
    slack = 1.0 + np.sqrt(C.shape[1] / X.shape[1])  # what the fit gains from noise alone
    if np.linalg.norm(Y - rounded @ X) <= slack * np.linalg.norm(Y - C @ X) + _ROUNDING * np.linalg.norm(Y):
        C = rounded  # sensors that copy states: the data do not contradict whole numbers
    misfit = np.linalg.norm(Y - C @ X) / np.linalg.norm(Y - Y.mean(axis=1, keepdims=True))
    if misfit > 0.5:  # noqa: PLR2004 - half of what moves in y is not explained by x
        raise HistoryError(
            f"y = C x leaves {misfit:.0%} of y unexplained: record y and x at the same instants, rows and columns alike"
        )
    order = _selected_states(C)
    if order is not None and order != sorted(order):
        raise HistoryError(
            f"y carries the states in the order {order}, expected ascending: put the columns of y in the order of x"
        )
    return np.asarray(C)


def _selected_states(C: NDArray[np.float64]) -> list[int] | None:
    """States that y copies, when every row of C is a row of the identity."""
    order = np.argmax(np.abs(C), axis=1)
    selection = np.eye(C.shape[1])[order]
    return [int(state) for state in order] if np.allclose(C, selection, rtol=0.0, atol=_SELECTION) else None
