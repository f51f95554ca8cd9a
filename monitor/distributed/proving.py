"""Solutions of (20) on columns that they have not seen, and signals in comparable units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monitor.distributed.gains import NodeGains
from monitor.proof import Trial, noise, prove, rounding

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from monitor.distributed.regressors import Regressors
    from monitor.distributed.solution import NodeSolution
    from monitor.proof import Proof

_SHARE = 5  # one column in five is held back
_FEWEST = 2
_COMPARABLE = 1e4  # spreads further apart than this are not in comparable units, whatever is said
_ROUNDING = 1e-10  # relative rounding of exact data
_TINY = 1e-300  # keeps 0 / 0 out


@dataclass(frozen=True, slots=True, kw_only=True)
class Scales:
    """Units of one node's signals: those of the states are the same for all nodes.

    Attributes:
        u: (m,).
        y: (p,).
        x: (n,).
    """

    u: NDArray[np.float64]
    y: NDArray[np.float64]
    x: NDArray[np.float64]

    def gains(self, scaled: NodeGains) -> NodeGains:
        """Gains of signals in these units, in the user's."""
        x, y = self.x[:, None], self.y[:, None]
        return NodeGains(
            E=x * scaled.E / self.x,
            F=x * scaled.F / self.u,
            L=x * scaled.L / self.y,
            H=x * scaled.H / self.y,
            C=y * scaled.C / self.x,
            chi=scaled.chi,
            start=self.x * scaled.start,
        )


def held_back(data: Regressors) -> tuple[Regressors, Regressors]:
    """The columns that the design sees, and the last fifth of them, which it does not."""
    cut = data.columns - max(_FEWEST, data.columns // _SHARE)
    return data.part(0, max(cut, 0)), data.part(max(cut, 0), data.columns)


def scales_of(data: Sequence[Regressors]) -> list[Scales]:
    """The spread of every signal, or 1 for all where units are comparable."""
    x = _spread(np.hstack([one.X for one in data]))
    found = [Scales(u=_spread(one.U), y=_spread(one.Y), x=x) for one in data]
    everything = np.concatenate([np.concatenate([one.u, one.y, one.x]) for one in found])
    if all(one.comparable for one in data) and np.max(everything) <= _COMPARABLE * np.min(everything):
        return [Scales(u=np.ones_like(one.u), y=np.ones_like(one.y), x=np.ones_like(x)) for one in found]
    return found


def prove_node(
    solution: NodeSolution, seen: Regressors, unseen: Regressors, correction: NDArray[np.float64] | None = None
) -> Proof:
    """Hold what a node without error predicts, Xdot and y, against the columns that were held back.

    Args:
        solution: of the node.
        seen: columns that it was found from.
        unseen: columns that were held back.
        correction: (n, p) Lt of the finished observer, which adds Lt (y - C x) to the prediction; None: 0.
    """
    Lt = np.zeros_like(solution.T_y) if correction is None else correction
    trials, before = _tried(solution, Lt, seen, unseen), _tried(solution, Lt, seen, seen)
    size = _spread(seen.Xdot)
    answers = np.hstack([solution.T_x, solution.T_u, solution.T_y, Lt])
    gain = float(np.max(np.linalg.norm(answers, axis=1) / size, initial=0.0))
    unknowns = len(seen.X) + len(seen.U) + solution.unknown_inputs
    allowed = rounding(_ROUNDING, gain, [trials])
    if not solution.exact:
        allowed = noise([before], unknowns, allowed)
    scales = (size, _spread(seen.Y))
    return prove([trials], allowed, scales, spare_columns=seen.columns - unknowns, estimate="prediction")


def _tried(solution: NodeSolution, Lt: NDArray[np.float64], seen: Regressors, data: Regressors) -> Trial:
    misfit = data.Y - solution.C @ data.X
    predicted = solution.T_x @ data.X + solution.T_u @ data.U + solution.T_y @ data.Ydot + Lt @ misfit
    moved, shown = _spread(seen.Xdot)[:, None], _spread(seen.Y)[:, None]
    size = max(
        (float(np.max(np.abs(table), initial=0.0)) for table in (data.Xdot / moved, data.Y / shown)), default=1.0
    )
    return Trial(error=((data.Xdot - predicted) / moved).T, residual=(misfit / shown).T, size=size)


def _spread(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard deviation of each row; its size where it never moves, 1 where there is nothing."""
    size = np.max(np.abs(rows), axis=1, initial=0.0)
    size = np.where(size > 0.0, size, 1.0)
    moved = size * np.std(rows / size[:, None], axis=1) if rows.shape[1] else np.zeros(len(rows))
    return np.asarray(np.where(moved > _TINY, moved, size))
