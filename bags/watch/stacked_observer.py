"""Linear observers of many links side by side."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from monitor.linear import Component, Vector, matvec
from monitor.observers import Estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class StackedObserver:
    """Linear observers of equal shape side by side: `LinearObserver` with matrices of components over links.

    Attributes:
        whole: [H J; M D; A B] of each link, shape (p + n + q, q + m + p, links).
        start: Z of each link, shape (q, m + p, links).
        inputs: m.
        outputs: p.
        states: n.
        lag: Steps by which the estimate lags the newest sample.
        period: Number of links after which the matrices repeat; None: they do not.
    """

    whole: NDArray[np.float64]
    start: NDArray[np.float64]
    inputs: int
    outputs: int
    states: int
    lag: int = 0
    period: int | None = None

    def init(self, u: Sequence[Component], y: Sequence[Component]) -> Vector:
        """State before the first sample is used."""
        return matvec(self.start, (*u, *y))

    def step(self, state: Vector, u: Sequence[Component], y: Sequence[Component]) -> tuple[Vector, Estimate]:
        """Estimate x_t and the residual from the samples up to t, and advance."""
        out = matvec(self.whole, (*state, *u, *y))
        known = self.outputs + self.states
        return out[known:], Estimate(estimate=out[self.outputs : known], residual=out[: self.outputs])

    def run(self, state: Vector, v: NDArray[np.float64]) -> tuple[NDArray[np.float64], Estimate]:
        """Take many samples v = (u, y) at once: the bits of `step`, one after the other.

        Only z_t+1 = A z_t + B v_t goes step by step, with the products B v_t made beforehand; the rest is made for all
        steps at once. Every sum starts from 0.0 and runs over the columns in order, as in `matvec`.

        Args:
            state: z_0, q components.
            v: Shape (steps, m + p, links).

        Returns:
            The state after them, and estimates (steps, n, links) and residuals (steps, p, links).
        """
        known, order = self.outputs + self.states, len(state)
        z = np.empty((len(v) + 1, order, v.shape[2]))
        z[0] = state
        columns = np.ascontiguousarray(self.whole[known:].swapaxes(0, 1))  # of [A B]
        driven = columns[order:] * v[:, :, None]  # (steps, m + p, q, links)
        for k in range(len(v)):
            total = np.zeros_like(z[0])
            for product in columns[:order] * z[k][:, None]:
                total += product
            for product in driven[k]:
                total += product
            z[k + 1] = total
        out = np.zeros((len(v), known, v.shape[2]))
        for column, component in enumerate((*z[:-1].swapaxes(0, 1), *v.swapaxes(0, 1))):
            out += self.whole[:known, column] * component[:, None]
        return z[-1], Estimate(estimate=out[:, self.outputs :], residual=out[:, : self.outputs])
