"""The offline experiment on the whole grid: what a team of monitors learns it from."""

import numpy as np

from dgu_sim.experiment import ExperimentData
from dgu_sim.linear import FloatArray
from dgu_sim.matrices import INPUTS
from dgu_sim.plant import physical_of, plant_of
from dgu_sim.records import Physical
from dgu_sim.scenario import Scenario
from dgu_sim.settings import Precision
from dgu_sim.signals import RandomSource, Stream
from dgu_sim.unit import equilibrium

__all__ = ["GRID", "run_grid_experiments"]

GRID = 0
"""Number of the whole grid where DGUs are numbered from 1."""


def run_grid_experiments(scenario: Scenario, samples: int) -> tuple[ExperimentData, ...]:
    """Run the offline experiments on all DGUs together, coupled as they are in the run, recorded at the same instants.

    x(0) is the grid's rest + U(-s, s); in every sample each load current is its operating value + U(-s, s) and each
    reference V_ref + U(-s, s), with spreads, noise and precision of the section `history`; secondary control is off.

    Returns:
        `history.experiments` experiments of so many samples: u (T, 2 N) holds I_L [A] and V_ref [V] of
        each DGU, ascending; y (T, 3 N), NaN where a component is not sent; x (T, 3 N). A pure function of the scenario.
    """
    return tuple(_experiment(scenario, samples, number) for number in range(scenario.history.experiments))


def _experiment(scenario: Scenario, samples: int, number: int) -> ExperimentData:
    history, dgus = scenario.history, scenario.grid.dgus
    generator = RandomSource(seed=scenario.seed, stream=Stream.HISTORY, dgu=GRID).generator(number)
    u = _inputs(scenario, samples, generator)
    start = np.array([equilibrium(scenario, dgu) for dgu in dgus])
    x = _trajectory(scenario, start + generator.uniform(-1.0, 1.0, start.shape) * history.state_spread, u)
    if history.noise_std > 0.0:
        generator = RandomSource(seed=scenario.seed, stream=Stream.HISTORY_NOISE, dgu=GRID).generator(number)
        x, u = (table + history.noise_std * generator.standard_normal(table.shape) for table in (x, u))
    if history.precision is Precision.FLOAT32:
        x, u = (table.astype(np.float32).astype(np.float64) for table in (x, u))
    sent = np.concatenate([np.array(scenario.dgu(dgu).sent) for dgu in dgus])
    nothing = np.empty((samples, 0))
    return ExperimentData(
        u=u,
        y=np.where(sent, x, np.nan),
        x=x,
        d=nothing,
        w=nothing,
        sampling_period_sec=scenario.sampling_period_sec,
    )


def _inputs(scenario: Scenario, samples: int, generator: np.random.Generator) -> FloatArray:
    nominal = np.array([[one.nominal_load, one.reference_v] for one in scenario.dgus])
    spread = np.array([scenario.history.load_spread_a, scenario.history.reference_spread_v])
    drawn = scenario.history.excitation.rows(generator, nominal.size, samples).reshape(samples, *nominal.shape)
    return (nominal + spread * drawn).reshape(samples, INPUTS * len(nominal))


def _trajectory(scenario: Scenario, start: FloatArray, u: FloatArray) -> FloatArray:
    """Return the states, shape (T, 3 N), of the DGUs stepped together as in a run."""
    grid, coupling = scenario.grid, scenario.coupling
    plants = {dgu: plant_of(grid, coupling, scenario.sampling_period_sec, dgu) for dgu in grid.dgus}
    felt_by = {dgu: physical_of(grid, coupling, dgu) for dgu in grid.dgus}
    x = {dgu: tuple(map(float, row)) for dgu, row in zip(grid.dgus, start, strict=True)}
    rows = [start.ravel()]
    for inputs in u[:-1].reshape(len(u) - 1, len(grid.dgus), INPUTS).tolist():
        felt = {
            dgu: Physical(x=x[dgu], load_current=load, reference=reference)
            for dgu, (load, reference) in zip(grid.dgus, inputs, strict=True)
        }
        for dgu, own in felt.items():
            others = [felt[other] for other in felt_by[dgu]]
            x[dgu] = tuple(map(float, plants[dgu].step(own.x, own.load_current, own.reference, others)))
        rows.append(np.array([x[dgu] for dgu in grid.dgus]).ravel())
    return np.array(rows)
