"""Simulation of DC microgrids under attack: plant, control, communication relay, scenarios."""

from dgu_sim.errors import AttackError, DguSimError, ScenarioError
from dgu_sim.experiment import ExperimentData, run_experiments
from dgu_sim.grid import Link
from dgu_sim.records import Physical, Sample
from dgu_sim.relay import Relay, RelayEvent, RelayState
from dgu_sim.scenario import Scenario, load_scenario, parse_scenario
from dgu_sim.simulate import Block, RunEvent, relay_of, simulate
from dgu_sim.unit import Unit, UnitOutput, UnitState, unit_of

__all__ = [
    "AttackError",
    "Block",
    "DguSimError",
    "ExperimentData",
    "Link",
    "Physical",
    "Relay",
    "RelayEvent",
    "RelayState",
    "RunEvent",
    "Sample",
    "Scenario",
    "ScenarioError",
    "Unit",
    "UnitOutput",
    "UnitState",
    "load_scenario",
    "parse_scenario",
    "relay_of",
    "run_experiments",
    "simulate",
    "unit_of",
]
