"""A small run, recorded once, and the pieces that tests put together themselves."""

from pathlib import Path

import pytest

from bags.runs.offline import simulate_to_bag
from bags.runs.reader import read_run
from bags.runs.run_record import RunRecord
from bags.watch.scenarios import parse_scenario
from bags.wire.schema import RunTopics, run_topics
from dgu_sim.scenario import Scenario

_SCENARIO = """
name: three_dgus
seed: 7
duration_sec: 2.4
coupling: held
dgus:
  - {id: 1, resistance_ohm: 0.2, inductance_h: 1.8e-3, capacitance_f: 2.2e-3, k1: -2.134, k2: -0.163, k3: 13.553,
     reference_v: 48.0, load: [{kind: constant, current_a: 10.0}]}
  - {id: 2, resistance_ohm: 0.3, inductance_h: 2.0e-3, capacitance_f: 1.9e-3, k1: -0.869, k2: -0.050, k3: 48.285,
     reference_v: 48.0, load: [{kind: constant, current_a: 12.0}]}
  - {id: 3, resistance_ohm: 0.1, inductance_h: 2.2e-3, capacitance_f: 1.7e-3, k1: -0.480, k2: -0.108, k3: 30.673,
     reference_v: 48.0, load: [{kind: constant, current_a: 15.0}]}
lines:
  - {between: [1, 2], resistance_ohm: 0.05}
  - {between: [1, 3], resistance_ohm: 0.07}
noise: {kind: gaussian, std: [0.01, 0.01, 0.001]}
monitor:
  detector: {options: {settle_sec: 0.1, calibrate_sec: 0.5, margin: 3.0}}
attacks:
  - {kind: bias, link: "1-2", start_sec: 1.0, stop_sec: 1.5, bias: [0.1, 0.1, 0.1]}
  - {kind: bias, link: "3-1", start_sec: 2.0, bias: [0.5, 0.0, 0.0]}
"""


@pytest.fixture(scope="session")
def scenario() -> Scenario:
    """Three DGUs, four directed links, noise, an attack that ends and one that does not."""
    return parse_scenario(_SCENARIO)


@pytest.fixture(scope="session")
def topics(scenario: Scenario) -> RunTopics:
    """The topics of the scenario's run."""
    return run_topics(scenario.grid.dgus, scenario.links, scenario.sampling_period_ns)


@pytest.fixture(scope="session")
def bag(scenario: Scenario, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The scenario's bag, made without ROS; tests must not change it."""
    return simulate_to_bag(scenario, tmp_path_factory.mktemp("recorded") / "run")


@pytest.fixture(scope="session")
def record(bag: Path) -> RunRecord:
    """The scenario's run as it is read back."""
    return read_run(bag)
