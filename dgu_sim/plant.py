"""The sampled physics of one DGU under three couplings; the same code steps one DGU and all of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np

from dgu_sim.grid import Grid
from dgu_sim.linear import Component, FloatArray, Matrix, Vector, add, matvec, stack_matrices, stack_vectors
from dgu_sim.matrices import INPUTS, STATES, continuous, continuous_joint, discretise
from dgu_sim.records import Physical

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
        AE: [A E], 3 rows of 5 components.
    """

    AE: Matrix

    def step(self, x: Vector, load_current: Component, reference: Component, physical: Sequence[Physical]) -> Vector:
        """Return x at step k + 1."""
        del physical
        return matvec(self.AE, (*x, load_current, reference))


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldPlant:
    """x+ = A x + E d, d = [I_L - sum_j V_j / R_ij, V_ref + alpha] with V_j held over the sample.

    The own line conductances are part of A (A_c[0,0] = -sum_j 1/(R_ij C_t)): exchanging held line currents
    instead is unstable.

    Attributes:
        AE: [A E], 3 rows of 5 components.
        conductances: 1/R_ij [S] of each slot, 0 where a DGU has fewer lines than slots.
    """

    AE: Matrix
    conductances: Vector

    def step(self, x: Vector, load_current: Component, reference: Component, physical: Sequence[Physical]) -> Vector:
        """Return x at step k + 1."""
        inflow: Component = 0.0
        for conductance, other in zip(self.conductances, physical, strict=True):
            inflow = inflow + conductance * other.x[0]
        return matvec(self.AE, (*x, load_current - inflow, reference))


@dataclass(frozen=True, slots=True, kw_only=True)
class JointPlant:
    """x_i+ = sum_j A_ij x_j + E_ij w_j, w_j = [I_L,j, V_ref,j + alpha_j]: the jointly integrated grid.

    Attributes:
        own: [A_ii E_ii], 3 rows of 5 components.
        others: [A_ij E_ij] of each slot, zero where a DGU has fewer others than slots.
    """

    own: Matrix
    others: tuple[Matrix, ...]

    def step(self, x: Vector, load_current: Component, reference: Component, physical: Sequence[Physical]) -> Vector:
        """Return x at step k + 1."""
        total = matvec(self.own, (*x, load_current, reference))
        for AE, other in zip(self.others, physical, strict=True):
            total = add(total, matvec(AE, (*other.x, other.load_current, other.reference)))
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
    return _plants(grid, coupling, sampling_period_sec, (dgu,))[0]


def plant_of_all(grid: Grid, coupling: Coupling, sampling_period_sec: float) -> Plant:
    """Return the physics of all DGUs as one plant whose components have a last axis "DGUs"."""
    plants = _plants(grid, coupling, sampling_period_sec, grid.dgus)
    slots = max(len(physical_of(grid, coupling, dgu)) for dgu in grid.dgus)
    if coupling is Coupling.HELD:
        held = [plant for plant in plants if isinstance(plant, HeldPlant)]
        padded = [(*plant.conductances, *[0.0] * slots)[:slots] for plant in held]
        return HeldPlant(AE=stack_matrices([plant.AE for plant in held]), conductances=stack_vectors(padded))
    if coupling is Coupling.JOINT:
        zero: Matrix = ((0.0,) * (STATES + INPUTS),) * STATES
        joint = [plant for plant in plants if isinstance(plant, JointPlant)]
        others = [(*plant.others, *[zero] * slots) for plant in joint]
        return JointPlant(
            own=stack_matrices([plant.own for plant in joint]),
            others=tuple(stack_matrices([other[slot] for other in others]) for slot in range(slots)),
        )
    return IsolatedPlant(AE=stack_matrices([plant.AE for plant in plants if isinstance(plant, IsolatedPlant)]))


def _plants(grid: Grid, coupling: Coupling, sampling_period_sec: float, dgus: Sequence[int]) -> list[Plant]:
    if coupling is Coupling.JOINT:
        return _joint_plants(grid, sampling_period_sec, dgus)
    plants: list[Plant] = []
    for dgu in dgus:
        conductances = grid.conductances(dgu) if coupling is Coupling.HELD else {}
        AE = _sampled(*continuous(grid.parameters[dgu], sum(conductances.values())), sampling_period_sec)
        if coupling is Coupling.HELD:
            plants.append(HeldPlant(AE=AE, conductances=tuple(conductances.values())))
        else:
            plants.append(IsolatedPlant(AE=AE))
    return plants


def _joint_plants(grid: Grid, sampling_period_sec: float, dgus: Sequence[int]) -> list[Plant]:
    A, E = discretise(*continuous_joint(grid), sampling_period_sec)
    position = {dgu: index for index, dgu in enumerate(grid.dgus)}

    def block(target: int, source: int) -> Matrix:
        i, j = position[target], position[source]
        rows = slice(STATES * i, STATES * (i + 1))
        left = A[rows, STATES * j : STATES * (j + 1)]
        right = E[rows, INPUTS * j : INPUTS * (j + 1)]
        return _rows(np.hstack([left, right]))

    return [
        JointPlant(
            own=block(dgu, dgu),
            others=tuple(block(dgu, other) for other in physical_of(grid, Coupling.JOINT, dgu)),
        )
        for dgu in dgus
    ]


def _sampled(A_c: FloatArray, E_c: FloatArray, sampling_period_sec: float) -> Matrix:
    return _rows(np.hstack(discretise(A_c, E_c, sampling_period_sec)))


def _rows(M: FloatArray) -> Matrix:
    """Return rows of Python floats: numpy scalars would slow the step of one DGU down tenfold."""
    return tuple(tuple(float(value) for value in row) for row in M)
