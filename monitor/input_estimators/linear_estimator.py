"""The running part of every linear estimator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from monitor.linear import Component, Vector
    from monitor.observer import Observer


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearInputEstimator:
    """z_t+1 = A z_t + B y_t,  dhat_(t - lag) = M z_t + D y_t.

    Attributes:
        realisation: an observer without known inputs whose "state estimate" is dhat.
        lag: samples by which dhat is behind.
    """

    realisation: Observer
    lag: int

    @property
    def inputs(self) -> int:
        """Number m_d of unknown inputs."""
        return self.realisation.states

    @property
    def outputs(self) -> int:
        """Number p of outputs."""
        return self.realisation.outputs

    def init(self, y: Sequence[Component]) -> Vector:
        """State before the first sample is used."""
        return self.realisation.init((), y)

    def step(self, state: Vector, y: Sequence[Component]) -> tuple[Vector, Vector]:
        """Take one sample."""
        following, estimate = self.realisation.step(state, (), y)
        return following, estimate.estimate
