"""The offline experiment: what a monitor learns a DGU from (T, section V)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dgu_sim.linear import FloatArray, Vector
from dgu_sim.plant import Coupling, Plant, physical_of, plant_of
from dgu_sim.records import Physical
from dgu_sim.scenario import Scenario
from dgu_sim.settings import HistoryPlant, Precision
from dgu_sim.signals import RandomSource, Stream

__all__ = ["ExperimentData", "run_experiments"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentData:
    """One recorded experiment of T samples.

    Attributes:
        u: Known inputs, shape (T, 0): a DGU has none (T: B = 0).
        y: Outputs, shape (T, 3): V [V], I_t [A], v [V s] (C = I); NaN where a component is not sent.
        x: States, shape (T, 3), same units.
        d: Inputs that are unknown online, shape (T, 2): I_net + I_L [A] with I_net = -sum_j V_j / R_ij of the lines
            (0 without lines), and V_ref + alpha [V].
        w: What only the DGU itself measures, shape (T, 1 + neighbours): I_L [A], and the neighbours' bus voltages [V],
            ascending; no neighbours without lines.
        sampling_period_sec: T_s.
    """

    u: FloatArray
    y: FloatArray
    x: FloatArray
    d: FloatArray
    w: FloatArray
    sampling_period_sec: float


def run_experiments(scenario: Scenario, dgu: int) -> tuple[ExperimentData, ...]:
    """Run the offline experiments of one DGU: random initial state, exciting unknown input.

    x(0) ~ U(-s, s); in every sample the load current is its operating value + U(-s, s), the reference
    V_ref + U(-s, s), and, where the DGU hangs on its lines, each neighbour's voltage V_ref,j + U(-s, s); with another
    `history.excitation` than `uniform` its signals take the place of U(-1, 1). With history.plant `joint` all DGUs
    connected to this one are excited like this and integrated together.

    Args:
        scenario: Its `history` section says how.
        dgu: Number of the DGU.

    Returns:
        `history.experiments` experiments, a pure function of scenario (with its seed) and DGU.

    Raises:
        ScenarioError: The scenario has no such DGU.
    """
    scenario.dgu(dgu)
    record = _joint if scenario.history.plant is HistoryPlant.JOINT else _own
    return tuple(
        _observed(scenario, dgu, number, record(scenario, dgu, number))
        for number in range(scenario.history.experiments)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Trajectory:
    """What happened in one experiment, free of noise.

    Attributes:
        x: States, shape (T, 3).
        load: I_L, shape (T,) [A].
        reference: V_ref, shape (T,) [V].
        voltages: Bus voltages of the neighbours, ascending, shape (T, neighbours) [V].
    """

    x: FloatArray
    load: FloatArray
    reference: FloatArray
    voltages: FloatArray


def _own(scenario: Scenario, dgu: int, number: int) -> _Trajectory:
    """Run the DGU with its own lines; the others are unknown input."""
    coupling = Coupling.ISOLATED if scenario.coupling is Coupling.ISOLATED else Coupling.HELD
    plant = plant_of(scenario.grid, coupling, scenario.sampling_period_sec, dgu)
    others = physical_of(scenario.grid, coupling, dgu)
    generator = _source(scenario, dgu, Stream.HISTORY).generator(number)
    x = _initial(scenario, generator)
    load, reference = _inputs(scenario, dgu, generator)
    spread = scenario.history.voltage_spread_v
    moved = scenario.history.excitation.signals(generator, len(others), scenario.history.samples) if others else ()
    voltages = {
        other: scenario.dgu(other).reference_v + spread * drawn for other, drawn in zip(others, moved, strict=True)
    }
    rows = [x]
    for k in range(scenario.history.samples - 1):
        physical = [
            Physical(x=(float(voltages[other][k]), 0.0, 0.0), load_current=0.0, reference=0.0) for other in others
        ]
        x = plant.step(x, load[k], reference[k], physical)
        rows.append(x)
    return _Trajectory(
        x=np.array(rows),
        load=np.array(load),
        reference=np.array(reference),
        voltages=_columns([voltages[other] for other in others], len(rows)),
    )


def _joint(scenario: Scenario, dgu: int, number: int) -> _Trajectory:
    """Run the DGU in the jointly integrated grid, everyone excited."""
    members = scenario.grid.component(dgu)
    plants: dict[int, Plant] = {
        one: plant_of(scenario.grid, Coupling.JOINT, scenario.sampling_period_sec, one) for one in members
    }
    generator = _source(scenario, dgu, Stream.HISTORY).generator(number)
    states = {one: _initial(scenario, generator) for one in members}
    inputs = {one: _inputs(scenario, one, generator) for one in members}
    rows = [states]
    for k in range(scenario.history.samples - 1):
        felt = {
            one: Physical(x=states[one], load_current=inputs[one][0][k], reference=inputs[one][1][k]) for one in members
        }
        states = {
            one: plants[one].step(
                states[one], inputs[one][0][k], inputs[one][1][k], [felt[other] for other in members if other != one]
            )
            for one in members
        }
        rows.append(states)
    load, reference = inputs[dgu]
    return _Trajectory(
        x=np.array([row[dgu] for row in rows]),
        load=np.array(load),
        reference=np.array(reference),
        voltages=_columns(
            [[float(row[other][0]) for row in rows] for other in scenario.grid.neighbours(dgu)], len(rows)
        ),
    )


def _columns(signals: Sequence[ArrayLike], samples: int) -> FloatArray:
    return np.array(signals, dtype=np.float64).reshape(len(signals), samples).T


def _initial(scenario: Scenario, generator: np.random.Generator) -> Vector:
    drawn = generator.uniform(-1.0, 1.0, 3) * scenario.history.state_spread
    return tuple(float(value) for value in drawn)


def _inputs(scenario: Scenario, dgu: int, generator: np.random.Generator) -> tuple[list[float], list[float]]:
    """Return load current [A] and reference [V] of every sample."""
    settings, history = scenario.dgu(dgu), scenario.history
    drawn = history.excitation.signals(generator, 2, history.samples)
    load = settings.nominal_load + history.load_spread_a * drawn[0]
    reference = settings.reference_v + history.reference_spread_v * drawn[1]
    return [float(value) for value in load], [float(value) for value in reference]


def _observed(scenario: Scenario, dgu: int, number: int, run: _Trajectory) -> ExperimentData:
    """Return the record of an experiment: with noise, rounded, and y = x because C = I."""
    history = scenario.history
    generator = _source(scenario, dgu, Stream.HISTORY_NOISE).generator(number)

    def recorded(signals: FloatArray) -> FloatArray:
        if history.noise_std > 0.0:
            signals = signals + history.noise_std * generator.standard_normal(signals.shape)
        return signals.astype(np.float32).astype(np.float64) if history.precision is Precision.FLOAT32 else signals

    conductances = np.array(list(scenario.grid.conductances(dgu).values()))[: run.voltages.shape[1]]
    x = recorded(run.x)
    return ExperimentData(
        u=np.empty((history.samples, 0)),
        y=np.where(scenario.dgu(dgu).sent, x, np.nan),
        x=x,
        d=recorded(np.column_stack([run.load - (run.voltages * conductances).sum(axis=1), run.reference])),
        w=recorded(np.column_stack([run.load, run.voltages])),
        sampling_period_sec=scenario.sampling_period_sec,
    )


def _source(scenario: Scenario, dgu: int, stream: Stream) -> RandomSource:
    return RandomSource(seed=scenario.seed, stream=stream, dgu=dgu)
