"""The sampled physics of one DGU under three couplings; the same code steps one DGU and all of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np

from dgu_sim.grid import Grid
from dgu_sim.linear import Component, FloatArray, Vector, add, stack_vectors
from dgu_sim.matrices import INPUTS, STATES, continuous, continuous_joint, discretise
from dgu_sim.records import Physical
from dgu_sim.transition import PairTransition, Transition, stack_transitions

__all__ = ["Coupling", "HeldPlant", "IsolatedPlant", "JointPlant", "Plant", "physical_of", "plant_of", "plant_of_all"]


class Coupling(StrEnum):
    """How a DGU feels the others."""

    ISOLATED = "isolated"
    HELD = "held"
    JOINT = "joint"


class Plant(Protocol):
    """One sample of physics. Components are floats, or arrays with a last axis "DGUs"."""

    def step(self, x: Vector, load_current: Component, reference: Component, physical: Sequence[Physical]) -> Vector:
        """Return x at step k + 1 from everything at step k; `physical` in the order of `physical_of`."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class IsolatedPlant:
    """x+ = A x + E d, d = [I_L, V_ref + alpha]: T (18) without lines.

    Attributes:
        transition: [A E].
    """

    transition: Transition

    def step(self, x: Vector, load_current: Component, reference: Component, physical: Sequence[Physical]) -> Vector:
        """Return x at step k + 1."""
        del physical
        return self.transition.apply(x, load_current, reference)


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldPlant:
    """x+ = A x + E d, d = [I_L - sum_j V_j / R_ij, V_ref + alpha] with V_j held over the sample.

    The own line conductances are part of A (A_c[0,0] = -sum_j 1/(R_ij C_t)): exchanging held line currents
    instead is unstable.

    Attributes:
        transition: [A E].
        conductances: 1/R_ij [S] of each slot, 0 where a DGU has fewer lines than slots.
    """

    transition: Transition
    conductances: Vector

    def step(self, x: Vector, load_current: Component, reference: Component, physical: Sequence[Physical]) -> Vector:
        """Return x at step k + 1."""
        inflow: Component = 0.0
        for conductance, other in zip(self.conductances, physical, strict=True):
            inflow = inflow + conductance * other.x[0]
        return self.transition.apply(x, load_current - inflow, reference)


@dataclass(frozen=True, slots=True, kw_only=True)
class JointPlant:
    """x_i+ = sum_j A_ij x_j + E_ij w_j, w_j = [I_L,j, V_ref,j + alpha_j]: the jointly integrated grid.

    Attributes:
        own: [A_ii E_ii].
        others: [A_ij E_ij] of each slot, zero where a DGU has fewer others than slots.
    """

    own: Transition
    others: tuple[Transition, ...]

    def step(self, x: Vector, load_current: Component, reference: Component, physical: Sequence[Physical]) -> Vector:
        """Return x at step k + 1."""
        total = self.own.apply(x, load_current, reference)
        for transition, other in zip(self.others, physical, strict=True):
            total = add(total, transition.apply(other.x, other.load_current, other.reference))
        return total


def physical_of(grid: Grid, coupling: Coupling, dgu: int) -> tuple[int, ...]:
    """Return the DGUs whose state at step k one DGU needs for step k + 1, ascending: the order of the slots."""
    if coupling is Coupling.HELD:
        return grid.neighbours(dgu)
    if coupling is Coupling.JOINT:
        return tuple(other for other in grid.component(dgu) if other != dgu)
    return ()


def plant_of(grid: Grid, coupling: Coupling, sampling_period_sec: float, dgu: int) -> Plant:
    """Return the physics of one DGU, in floats."""
    if coupling is Coupling.JOINT:
        own, others = _pairs(grid, discretise(*continuous_joint(grid), sampling_period_sec), dgu)
        return JointPlant(own=own, others=others)
    own, conductances = _single(grid, coupling, sampling_period_sec, dgu)
    if coupling is Coupling.HELD:
        return HeldPlant(transition=own, conductances=conductances)
    return IsolatedPlant(transition=own)


def plant_of_all(grid: Grid, coupling: Coupling, sampling_period_sec: float) -> Plant:
    """Return the physics of all DGUs as one plant whose components have a last axis "DGUs".

    Its coefficients are exactly those of `plant_of`; a DGU with fewer slots than others gets zeros.
    """
    slots = max(len(physical_of(grid, coupling, dgu)) for dgu in grid.dgus)
    if coupling is Coupling.JOINT:
        sampled = discretise(*continuous_joint(grid), sampling_period_sec)
        pairs = [_pairs(grid, sampled, dgu) for dgu in grid.dgus]
        padded = [(*others, *(_ZERO,) * slots)[:slots] for _, others in pairs]
        return JointPlant(
            own=stack_transitions([own for own, _ in pairs]),
            others=tuple(stack_transitions(slot) for slot in zip(*padded, strict=True)),
        )
    singles = [_single(grid, coupling, sampling_period_sec, dgu) for dgu in grid.dgus]
    transition = stack_transitions([own for own, _ in singles])
    if coupling is Coupling.HELD:
        conductances = stack_vectors([(*own, *(0.0,) * slots)[:slots] for _, own in singles])
        return HeldPlant(transition=transition, conductances=conductances)
    return IsolatedPlant(transition=transition)


def _single(
    grid: Grid, coupling: Coupling, sampling_period_sec: float, dgu: int
) -> tuple[PairTransition, tuple[float, ...]]:
    """Return [A E] of one DGU on its own, and the conductances of its lines [S] when they are part of A."""
    conductances = grid.conductances(dgu) if coupling is Coupling.HELD else {}
    A_c, E_c = continuous(grid.parameters[dgu], sum(conductances.values()))
    return _transition(*discretise(A_c, E_c, sampling_period_sec)), tuple(conductances.values())


def _pairs(
    grid: Grid, sampled: tuple[FloatArray, FloatArray], dgu: int
) -> tuple[PairTransition, tuple[PairTransition, ...]]:
    """Return [A_ii E_ii] and the [A_ij E_ij] of one DGU's slots, cut from the sampled joint grid."""
    A, E = sampled

    def pair(source: int) -> PairTransition:
        i, j = grid.dgus.index(dgu), grid.dgus.index(source)
        rows = slice(STATES * i, STATES * (i + 1))
        return _transition(A[rows, STATES * j : STATES * (j + 1)], E[rows, INPUTS * j : INPUTS * (j + 1)])

    return pair(dgu), tuple(pair(other) for other in physical_of(grid, Coupling.JOINT, dgu))


def _transition(A: FloatArray, E: FloatArray) -> PairTransition:
    """Return [A E] in Python floats: numpy scalars would slow the step of one DGU down tenfold."""
    rows = np.hstack([A, E]).tolist()
    return PairTransition(rows=tuple((a, b, c, d, e) for a, b, c, d, e in rows))


_ZERO = _transition(np.zeros((STATES, STATES)), np.zeros((STATES, INPUTS)))
