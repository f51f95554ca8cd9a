"""Observers of records that stand around an operating point: the constant 1 is one known input more."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monitor.batch import Estimates, received, run_linear
from monitor.linear_observer import LinearObserver

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from monitor.linear import Component, Vector
    from monitor.observer import Estimate, Observer

__all__ = ["ConstantInput", "linear_part"]


@dataclass(frozen=True, slots=True)
class ConstantInput:
    """An observer whose first known input is the constant 1: the operating point at which the history was recorded.

    Attributes:
        inner: the observer with that input.
    """

    inner: Observer

    @property
    def inputs(self) -> int:
        """Number m of known inputs besides the constant."""
        return self.inner.inputs - 1

    @property
    def outputs(self) -> int:
        """Number p of outputs it needs."""
        return self.inner.outputs

    @property
    def states(self) -> int:
        """Number of estimated components."""
        return self.inner.states

    @property
    def lag(self) -> int:
        """Steps by which the estimate lags the newest sample."""
        return self.inner.lag

    def init(self, u: Sequence[Component], y: Sequence[Component]) -> Vector:
        """State before the first sample is used."""
        return self.inner.init((1.0, *u), y)

    def step(self, state: Vector, u: Sequence[Component], y: Sequence[Component]) -> tuple[Vector, Estimate]:
        """Estimate from the samples up to t, and advance."""
        return self.inner.step(state, (1.0, *u), y)

    def run(self, u: ArrayLike | None, y: ArrayLike, x0: ArrayLike | None = None) -> Estimates:
        """Run over a whole recording, as `LinearObserver.run` does; u without the constant.

        Raises:
            HistoryError: the arrays do not have the columns that the observer was designed for, or x0 not n numbers.
        """
        inputs, outputs = received(self, u, y)
        return run_linear(linear_part(self), np.hstack([np.ones((len(outputs), 1)), inputs]), outputs, x0)


def linear_part(observer: LinearObserver | ConstantInput) -> LinearObserver:
    """The linear observer itself, or the one behind the constant input."""
    if isinstance(observer, LinearObserver):
        return observer
    assert isinstance(observer.inner, LinearObserver)  # noqa: S101 - designs are made of single observers
    return observer.inner
