"""One node of a sampled observer network as a process runs it: estimates out, estimates in."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from monitor.linear import Component, Flag, Matrix, Vector, matvec, rows_of, select

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from monitor.distributed.gains import NodeGains

_RANK = 1e-9  # relative: sensors that show the same differ by rounding only


class NodeOutput(NamedTuple):
    """What a node knows at one step and sends to its neighbours.

    Attributes:
        estimate: xhat_i, n components: the whole state.
        residual: y_i - C_i xhat_i, p components.
    """

    estimate: Vector
    residual: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeObserver:
    """Node i of D (6) in sampled form, in floats or arrays.

    xhat_t = z_t + H y_t;  z_t+1 = E z_t + F u_t + L y_t + chi sum_j a_ij (xhat_j,t - xhat_i,t).

    A step has two halves, so that nodes can exchange what the first gives before the second needs it: `output` at step
    t from (z_t, y_t), `step` to t + 1 with the estimates received for t. An estimate that has not come (a node that
    has not joined yet, has left, or a message that was lost) leaves its term out.

    Attributes:
        gains: of this node.
        neighbours: numbers of the nodes it hears, ascending.
        weights: a_ij of each.
        correction: (n, p) C^+, how a first output corrects a guess.
        begin: (n, p + 1) the state before the first output, from it and 1.
    """

    gains: NodeGains
    neighbours: tuple[int, ...]
    weights: tuple[float, ...]
    correction: NDArray[np.float64]
    begin: NDArray[np.float64]
    _advance: Matrix = field(init=False, repr=False, compare=False)
    _feed: Matrix = field(init=False, repr=False, compare=False)
    _misfit: Matrix = field(init=False, repr=False, compare=False)
    _begin: Matrix = field(init=False, repr=False, compare=False)
    _correction: Matrix = field(init=False, repr=False, compare=False)
    _direct: Matrix = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Lay the matrices out for stepping."""
        g = self.gains
        n, p = g.H.shape
        object.__setattr__(self, "_advance", rows_of(np.hstack([g.E, g.F, g.L])))
        object.__setattr__(self, "_feed", rows_of(np.hstack([np.eye(n), g.H])))
        object.__setattr__(self, "_misfit", rows_of(np.hstack([-g.C, np.eye(p)])))
        object.__setattr__(self, "_begin", rows_of(self.begin))
        object.__setattr__(self, "_correction", rows_of(self.correction))
        object.__setattr__(self, "_direct", rows_of(g.H))

    @classmethod
    def of(cls, gains: NodeGains, neighbours: tuple[int, ...], weights: tuple[float, ...]) -> NodeObserver:
        """Return the node with these gains, its start included."""
        correction = np.asarray(np.linalg.pinv(gains.C, rcond=_RANK), dtype=np.float64)
        mean = (np.eye(len(gains.H)) - correction @ gains.C) @ gains.start
        begin = np.hstack([correction - gains.H, mean[:, None]])
        return cls(gains=gains, neighbours=neighbours, weights=weights, correction=correction, begin=begin)

    def init(self, y: Sequence[Component]) -> Vector:
        """State before the first output is used: the mean state of the data, corrected to fit y."""
        return matvec(self._begin, (*y, 1.0))

    def join(self, y: Sequence[Component], guess: Vector) -> Vector:
        """State of a node that starts from what others estimate, corrected to fit its own first output."""
        misfit = matvec(self._misfit, (*guess, *y))
        estimate = [one + two for one, two in zip(guess, matvec(self._correction, misfit), strict=True)]
        return tuple([one - two for one, two in zip(estimate, matvec(self._direct, y), strict=True)])

    def output(self, state: Vector, y: Sequence[Component]) -> NodeOutput:
        """Estimate and residual at this step, from what the node itself measures."""
        estimate = matvec(self._feed, (*state, *y))
        return NodeOutput(estimate, matvec(self._misfit, (*estimate, *y)))

    def step(
        self,
        state: Vector,
        u: Sequence[Component],
        y: Sequence[Component],
        estimate: Vector,
        received: Sequence[tuple[Vector, Flag]],
    ) -> Vector:
        """State at the next step.

        Args:
            state: z at this step.
            u: known inputs, m components.
            y: outputs, p components.
            estimate: what `output` gave for this step.
            received: for each of `neighbours`, its estimate of the same step and whether it came.
        """
        following: Vector = matvec(self._advance, (*state, *u, *y))
        for weight, (other, came) in zip(self.weights, received, strict=True):
            pull = self.gains.chi * weight
            following = tuple(
                [
                    one + select(came, pull * (theirs - own), 0.0)
                    for one, theirs, own in zip(following, other, estimate, strict=True)
                ]
            )
        return following
