"""Simulation of DC microgrids under attack: plant, control, communication relay, scenarios."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dgu_sim.errors import AttackError, DguSimError, ScenarioError
    from dgu_sim.experiment import ExperimentData, run_experiments
    from dgu_sim.grid import Link
    from dgu_sim.records import Physical, Sample
    from dgu_sim.relay import Relay, RelayEvent, RelayState
    from dgu_sim.scenario import Scenario, load_scenario, parse_scenario
    from dgu_sim.simulate import Block, RunEvent, relay_of
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
    "unit_of",
]

_NAMES = {
    "dgu_sim.errors": ("AttackError", "DguSimError", "ScenarioError"),
    "dgu_sim.experiment": ("ExperimentData", "run_experiments"),
    "dgu_sim.grid": ("Link",),
    "dgu_sim.records": ("Physical", "Sample"),
    "dgu_sim.relay": ("Relay", "RelayEvent", "RelayState"),
    "dgu_sim.scenario": ("Scenario", "load_scenario", "parse_scenario"),
    "dgu_sim.simulate": ("Block", "RunEvent", "relay_of"),
    "dgu_sim.unit": ("Unit", "UnitOutput", "UnitState", "unit_of"),
}
_WHERE = {name: module for module, names in _NAMES.items() for name in names}

if not TYPE_CHECKING:  # a type checker shall know the names, and no others

    def __getattr__(name: str) -> object:
        """Import a name when it is first asked for: whoever wants one part does not wait for all (PEP 562)."""
        if name not in _WHERE:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(_WHERE[name]), name)
