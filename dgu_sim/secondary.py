"""Secondary consensus control: shares the load in proportion to the rated currents."""

from collections.abc import Sequence
from dataclasses import dataclass

from dgu_sim.grid import Grid
from dgu_sim.linear import Component, Vector, choose, stack, stack_vectors
from dgu_sim.records import Sample

__all__ = ["Consensus", "consensus_of", "consensus_of_all"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Consensus:
    """alpha_i+ = alpha_i + T_s k_I sum_j a_ij (I^c_j / I^r_j - I_i / I^r_i) (weighted form after Tucci et al. 2018).

    I^c_j is the *received* current, so this is where an attack enters the physics; I_i is the own measured one.

    Attributes:
        step_gain: T_s k_I [V/A for rated currents of 1 A].
        own_inverse_rating: 1 / I^r_i [1/A].
        inverse_ratings: 1 / I^r_j [1/A] of each neighbour slot (a_ij = 1). A DGU with fewer neighbours than slots
            receives nothing in the empty ones.
    """

    step_gain: float
    own_inverse_rating: Component
    inverse_ratings: Vector

    def step(self, alpha: Component, own_current: Component, received: Sequence[Sample]) -> Component:
        """Return alpha at step k + 1 [V]; a sample that is not delivered, or is NaN, drops its term."""
        own = own_current * self.own_inverse_rating
        total: Component = 0.0
        for inverse_rating, sample in zip(self.inverse_ratings, received, strict=True):
            current = sample.y[1]
            usable = sample.delivered & (current == current)  # noqa: PLR0124 - false for NaN, float or array
            total = total + choose(usable, current * inverse_rating - own, 0.0)
        return alpha + self.step_gain * total


def consensus_of(grid: Grid, rated_currents: Sequence[float], step_gain: float, dgu: int) -> Consensus:
    """Return the controller of one DGU, in floats; `rated_currents` [A] in the order of `grid.dgus`."""
    rated = dict(zip(grid.dgus, rated_currents, strict=True))
    neighbours = grid.neighbours(dgu)
    return Consensus(
        step_gain=step_gain,
        own_inverse_rating=1.0 / rated[dgu],
        inverse_ratings=tuple(1.0 / rated[other] for other in neighbours),
    )


def consensus_of_all(grid: Grid, rated_currents: Sequence[float], step_gain: float) -> Consensus:
    """Return the controllers of all DGUs as one whose components have a last axis "DGUs"."""
    each = [consensus_of(grid, rated_currents, step_gain, dgu) for dgu in grid.dgus]
    slots = max(len(one.inverse_ratings) for one in each)
    padding = (0.0,) * slots
    return Consensus(
        step_gain=step_gain,
        own_inverse_rating=stack([one.own_inverse_rating for one in each]),
        inverse_ratings=stack_vectors([(*one.inverse_ratings, *padding)[:slots] for one in each]),
    )
