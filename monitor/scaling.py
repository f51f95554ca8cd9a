"""Units do not matter: signals in shares of their own spread, and matrices back in the user's units.

A signal in the user's units is its scale times the scaled one: x = s_x * x_scaled. Decisions and tolerances live in the
scaled units; what leaves a design is in the user's. Scales come from finite samples only and are never zero.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from monitor.history import History
    from monitor.linear_observer import LinearObserver

_TABLES = ("u", "y", "x", "d", "w")
_COMPARABLE = 1e4  # states whose spreads lie further apart than this are not in comparable units, whatever is said


@dataclass(frozen=True, slots=True, kw_only=True)
class Scaling:
    """Scale of every signal of a history, in the user's units.

    Attributes:
        u: (m,) known inputs.
        y: (p,) outputs.
        x: (n,) states.
        d: (m_d,) applied inputs, empty unless recorded.
        w: what only the DGU measures, empty unless recorded.
    """

    u: NDArray[np.float64]
    y: NDArray[np.float64]
    x: NDArray[np.float64]
    d: NDArray[np.float64]
    w: NDArray[np.float64]

    @property
    def v(self) -> NDArray[np.float64]:
        """(m + p,) scales of what an observer receives, (u, y)."""
        return np.concatenate([self.u, self.y])

    def scaled(self, history: History) -> History:
        """The history in scaled units."""
        scaled = (
            replace(one, **{name: getattr(one, name) / getattr(self, name) for name in _TABLES})
            for one in history.experiments
        )
        return replace(history, experiments=tuple(scaled))

    def noise(self, std: ArrayLike) -> NDArray[np.float64]:
        """(n,) standard deviations of noise on x, one number or one a state in the user's units, in scaled ones."""
        return np.broadcast_to(np.asarray(std, dtype=np.float64), self.x.shape) / self.x

    def relative_to(self, other: Scaling) -> Scaling:
        """Scales of this one's signals in units of the other: scaled by it = (self / other) * scaled by self."""
        return Scaling(**{name: getattr(self, name) / getattr(other, name) for name in _TABLES})

    def observer(self, scaled: LinearObserver, state: NDArray[np.float64]) -> LinearObserver:
        """An observer designed in scaled units, in the user's.

        Args:
            scaled: takes and gives scaled signals.
            state: (q,) scale of each component of its state z, 1 where z has no unit.
        """
        into = self.v
        return replace(
            scaled,
            A=state[:, None] * scaled.A / state,
            B=state[:, None] * scaled.B / into,
            M=self.x[:, None] * scaled.M / state if len(scaled.M) else scaled.M / state,
            D=self.x[:, None] * scaled.D / into if len(scaled.D) else scaled.D / into,
            H=self.y[:, None] * scaled.H / state,
            J=self.y[:, None] * scaled.J / into,
            Z=state[:, None] * scaled.Z / into,
        )


def spreads(history: History) -> Scaling:
    """Scale every signal by its own standard deviation over all finite samples."""
    return Scaling(**{name: _spread([getattr(one, name) for one in history.experiments]) for name in _TABLES})


def norms(history: History, spread: Scaling) -> Scaling:
    """Units in which a design may call one signal as large as another: for norms, weights and unknown noise.

    Their own spread, unless the history says that its units are comparable as they are (V, A, V s of a DGU). Then
    T's least norm is that of the paper. A history whose states spread over more than four decades is not believed.
    """
    everything = np.concatenate([spread.u, spread.y, spread.x])
    if not history.comparable or np.max(everything) > _COMPARABLE * np.min(everything):
        return spread
    return Scaling(**{name: np.ones_like(getattr(spread, name)) for name in _TABLES})


def _spread(tables: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Standard deviation of each column; its size where it never moves, 1 where there is nothing."""
    table = np.vstack(tables)
    finite = np.isfinite(table)
    size = np.max(np.abs(table), axis=0, initial=0.0, where=finite)
    size = np.where(size > 0.0, size, 1.0)  # first by its size: squares neither overflow nor vanish
    share = np.divide(table, size, out=np.zeros_like(table), where=finite)
    count = np.maximum(np.count_nonzero(finite, axis=0), 1)
    mean = np.sum(share, axis=0) / count
    variance = np.sum((share - mean) ** 2, axis=0, where=finite) / count
    return np.asarray(np.where(variance > 0.0, size * np.sqrt(variance), size))
