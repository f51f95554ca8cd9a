"""The subspace of all one-step trajectories (u_t, x_t, y_t, u_t+1, x_t+1, y_t+1) that the history spans."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from monitor.errors import HistoryError
from monitor.history import data_matrices
from monitor.output_map import Misfit, identify_output_map

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.history import DataMatrices, History


def _nothing() -> NDArray[np.float64]:
    return np.empty((0, 0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Behaviour:
    """What the data say once the rank is decided; every column of L is a one-step trajectory of the plant.

    Attributes:
        L_u: (m, r) known inputs at t, r = 2m + n + m_d, plus rank G where unknown inputs act on y directly.
        L_x: (n, r) states at t.
        L_uf: (m, r) known inputs at t + 1.
        L_xf: (n, r) states at t + 1.
        C: (p, n) output map, y = C x + D u + G d.
        unknown_inputs: m_d.
        D: (p, m) feedthrough; zero unless given.
        L_g: (p, r) G d at t; zero unless given.
        L_gf: (p, r) G d at t + 1; zero unless given.
        C_error: how wrong C may be for the noise of the outputs, in the 2-norm.
    """

    L_u: NDArray[np.float64]
    L_x: NDArray[np.float64]
    L_uf: NDArray[np.float64]
    L_xf: NDArray[np.float64]
    C: NDArray[np.float64]
    unknown_inputs: int
    D: NDArray[np.float64] = field(default_factory=_nothing)
    L_g: NDArray[np.float64] = field(default_factory=_nothing)
    L_gf: NDArray[np.float64] = field(default_factory=_nothing)
    C_error: float = 0.0

    def __post_init__(self) -> None:
        """Fill in what is zero."""
        p, r = len(self.C), self.L_x.shape[1]
        for name, shape in (("D", (p, len(self.L_u))), ("L_g", (p, r)), ("L_gf", (p, r))):
            if getattr(self, name).shape == (0, 0):
                object.__setattr__(self, name, np.zeros(shape))

    @property
    def L_y(self) -> NDArray[np.float64]:  # noqa: N802 - as its siblings
        """(p, r) outputs at t."""
        return self.C @ self.L_x + self.D @ self.L_u + self.L_g

    @property
    def L_yf(self) -> NDArray[np.float64]:  # noqa: N802 - as its siblings
        """(p, r) outputs at t + 1."""
        return self.C @ self.L_xf + self.D @ self.L_uf + self.L_gf

    @property
    def undisturbed(self) -> NDArray[np.float64]:
        """(p - rank G, p) orthonormal rows that no unknown input reaches directly: rows @ y = rows @ (C x + D u)."""
        if not self.L_gf.any():
            return np.eye(len(self.C))
        left, values, _ = np.linalg.svd(self.L_gf)
        return np.asarray(left[:, int(np.count_nonzero(values > _DIRECT * values[0])) :].T)

    @property
    def stacked(self) -> NDArray[np.float64]:
        """[U_p; Y_p; X_p; U_f; Y_f] of T (13) on the trajectories of the basis."""
        return np.vstack([self.L_u, self.L_y, self.L_x, self.L_uf, self.L_yf])

    def in_units(self, u: NDArray[np.float64], y: NDArray[np.float64], x: NDArray[np.float64]) -> Behaviour:
        """The same behaviour with every signal multiplied by its factor; the basis is orthonormal in the new units."""
        blocks = [u[:, None] * self.L_u, x[:, None] * self.L_x, u[:, None] * self.L_uf, x[:, None] * self.L_xf]
        blocks += [y[:, None] * self.L_g, y[:, None] * self.L_gf]
        basis, _ = np.linalg.qr(np.vstack(blocks))
        parts = np.split(basis, np.cumsum([len(block) for block in blocks[:-1]]))
        L_u, L_x, L_uf, L_xf, L_g, L_gf = parts
        C, D = y[:, None] * self.C / x, y[:, None] * self.D / u
        return replace(self, L_u=L_u, L_x=L_x, L_uf=L_uf, L_xf=L_xf, L_g=L_g, L_gf=L_gf, C=C, D=D)


_DIRECT = 1e-9  # relative: a direction of G below is rounding


def identify_direct(history: History) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Find C and G of y = C x + G d where d was recorded.

    Raises:
        HistoryError: y is no static function of x and d.
    """
    try:
        alone = identify_output_map(data_matrices(history))
        if all(kind is Misfit.NOTHING for kind in alone.kinds):
            return alone.C, np.zeros((len(alone.C), history.experiments[0].d.shape[1]))
    except HistoryError:
        pass  # states alone do not explain y: d may
    known = [replace(one, u=one.d) for one in history.experiments]
    found = identify_output_map(data_matrices(replace(history, experiments=tuple(known))))
    for row in np.flatnonzero(found.driven):
        raise HistoryError(
            f"y[{row}] = C x + G d leaves {found.misfit[row]:.2g} of its spread unexplained, by an input that was not "
            "recorded: record it in d, or record y and x at the same instants"
        )
    return found.C, found.D


def identify_output(data: DataMatrices) -> NDArray[np.float64]:
    """Find C = Y X^+ of y = C x (reduced-order UIO paper, below (10)), for methods that know no feedthrough.

    Raises:
        HistoryError: y is no static function of x alone.
    """
    found = identify_output_map(data)
    for row, kind in enumerate(found.kinds):
        if kind is Misfit.UNKNOWN_INPUT:
            raise HistoryError(
                f"y[{row}] = C x leaves {found.misfit[row]:.2g} of its spread unexplained, by an unknown input that "
                "acts on it directly: use full_order or reduced_order, or record y and x at the same instants"
            )
        if found.D[row].any():
            raise HistoryError(
                f"y[{row}] holds known inputs as well as states (y = C x + D u): use full_order or reduced_order"
            )
    return found.C
