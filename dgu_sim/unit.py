"""One DGU as a node runs it: plant, secondary control, loads and noise in Python floats."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from dgu_sim.cell import Cell, UnitOutput, UnitState
from dgu_sim.commands import Command
from dgu_sim.exogenous import DguExogenous, GridExogenous
from dgu_sim.linear import stack
from dgu_sim.noise import NoNoise
from dgu_sim.plant import Coupling, physical_of, plant_of, plant_of_all
from dgu_sim.records import Physical, Sample
from dgu_sim.scenario import Scenario
from dgu_sim.secondary import consensus_of, consensus_of_all
from dgu_sim.steering import DguSteering, GridSteering

__all__ = ["Physical", "Sample", "Unit", "UnitOutput", "UnitState", "cell_of_all", "equilibrium", "unit_of"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Unit:
    """One DGU and whom it needs to hear from.

    Attributes:
        dgu: Its number.
        neighbours: DGUs whose received output it needs, ascending.
        physical: DGUs whose true state it needs, ascending.
        cell: The step, shared with the simulation of all DGUs at once.
    """

    dgu: int
    neighbours: tuple[int, ...]
    physical: tuple[int, ...]
    cell: Cell

    def init(self) -> UnitState:
        """Return the state at step 0."""
        return self.cell.init()

    def steer(self, state: UnitState, command: Command) -> UnitState:
        """Return the state at step k after a command that acts from step k on; one on another DGU changes nothing."""
        return self.cell.steer(state, command)

    def output(self, state: UnitState) -> UnitOutput:
        """Return what the DGU does and sends at step k."""
        return self.cell.output(state)

    def step(self, state: UnitState, physical: Sequence[Physical], received: Sequence[Sample]) -> UnitState:
        """Return the state at step k + 1.

        Args:
            state: The state at step k.
            physical: Step k of the DGUs in `physical`, in that order.
            received: Step k as received from the DGUs in `neighbours`, in that order.
        """
        return self.cell.step(state, physical, received)


def unit_of(scenario: Scenario, dgu: int) -> Unit:
    """Return one DGU of a scenario.

    Raises:
        ScenarioError: The scenario has no such DGU.
    """
    settings = scenario.dgu(dgu)
    grid = scenario.grid
    rated = [one.rated_current_a for one in scenario.dgus]
    step_gain = scenario.sampling_period_sec * scenario.secondary.gain
    return Unit(
        dgu=dgu,
        neighbours=grid.neighbours(dgu),
        physical=physical_of(grid, scenario.coupling, dgu),
        cell=Cell(
            plant=plant_of(grid, scenario.coupling, scenario.sampling_period_sec, dgu),
            consensus=consensus_of(grid, rated, step_gain, dgu) if scenario.secondary.enabled else None,
            exogenous=_exogenous(scenario, dgu, (scenario.seed,))[0],
            reference=settings.reference_v,
            hidden=tuple(0.0 if sent else math.nan for sent in settings.sent) if _hides(scenario) else None,
            unsteered=DguSteering(dgu=dgu, sampling_period_sec=scenario.sampling_period_sec),
        ),
    )


def cell_of_all(scenario: Scenario, seeds: Sequence[int]) -> Cell:
    """Return all DGUs of a scenario in one cell, components of shape (runs, DGUs), one run for each seed."""
    grid = scenario.grid
    rated = [one.rated_current_a for one in scenario.dgus]
    step_gain = scenario.sampling_period_sec * scenario.secondary.gain
    masks = [[0.0 if sent else math.nan for sent in one.sent] for one in scenario.dgus]
    return Cell(
        plant=plant_of_all(grid, scenario.coupling, scenario.sampling_period_sec),
        consensus=consensus_of_all(grid, rated, step_gain) if scenario.secondary.enabled else None,
        exogenous=GridExogenous(
            members=tuple(zip(*(_exogenous(scenario, dgu, seeds) for dgu in grid.dgus), strict=True))
        ),
        reference=stack([one.reference_v for one in scenario.dgus]),
        hidden=tuple(stack(column) for column in zip(*masks, strict=True)) if _hides(scenario) else None,
        unsteered=GridSteering(dgus=grid.dgus, sampling_period_sec=scenario.sampling_period_sec),
    )


def equilibrium(scenario: Scenario, dgu: int) -> tuple[float, float, float]:
    """Return V [V], I_t [A], v [V s] of one DGU at rest for alpha = 0 and the loads of t = 0.

    V = V_ref (the integrator sees to it), I_t = I_L + sum_j (V_ref,i - V_ref,j) / R_ij,
    (k1 - 1) V + (k2 - R_t) I_t + k3 v = 0.
    """
    settings = scenario.dgu(dgu)
    p = settings.parameters
    V = settings.reference_v
    I_t = settings.nominal_load
    if scenario.coupling is not Coupling.ISOLATED:
        for other, conductance in scenario.grid.conductances(dgu).items():
            I_t += conductance * (V - scenario.dgu(other).reference_v)
    return V, I_t, -((p.k1 - 1.0) * V + (p.k2 - p.R_t) * I_t) / p.k3


def _hides(scenario: Scenario) -> bool:
    """Whether any DGU of the scenario keeps a component of its output to itself."""
    return not all(all(one.sent) for one in scenario.dgus)


def _exogenous(scenario: Scenario, dgu: int, seeds: Sequence[int]) -> tuple[DguExogenous, ...]:
    """Return the signals of one DGU in the run of each seed."""
    settings = scenario.dgu(dgu)
    given = settings.initial_state
    initial_state = equilibrium(scenario, dgu) if isinstance(given, str) else given
    return tuple(
        DguExogenous(
            seed=seed,
            dgu=dgu,
            loads=settings.load,
            noise=None if isinstance(scenario.noise, NoNoise) else scenario.noise,
            initial_state=initial_state,
            initial_spread=settings.initial_spread,
            sampling_period_sec=scenario.sampling_period_sec,
        )
        for seed in seeds
    )
