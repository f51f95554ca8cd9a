"""How many times faster than a loop of `scipy.signal.dlsim` a thousand runs are, by engine: `make bench` prints it."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

from engine import NUMPY, VARIABLE, available

pytestmark = pytest.mark.bench

# Six DGUs, 14 monitors with the fixed detector, runs of 1,000 steps side by side; seconds of CPU, scaled to 1,000 runs.
# The peer steps the plant alone.
MEASURE = """
import json, resource, sys, time
import numpy as np
from scipy.signal import dlsim
from bags.watch.monitors import link_monitors
from bags.watch.scenarios import load_scenario
from dcmg.shipped import scenario_path
from dgu_sim.matrices import continuous_joint, discretise
from dgu_sim.simulate import simulate

RUNS, BLOCK, PEERS = int(sys.argv[2]), 16, 40
scenario = load_scenario(scenario_path("gallo_six_dgu"), ["duration_sec=10", "attacks=[]", *json.loads(sys.argv[1])])
A, E = discretise(*continuous_joint(scenario.grid), 0.01)
system = (A, E, np.eye(len(A)), np.zeros(E.shape), 0.01)
draw = np.random.default_rng(1)

def seconds(work):
    start = time.process_time()
    work()
    return time.process_time() - start

def peers():
    for _ in range(PEERS):
        dlsim(system, draw.standard_normal((scenario.steps, E.shape[1])))

def ours(verdicts):
    monitors = link_monitors(scenario, RUNS)
    states = monitors.init()
    for block in simulate(scenario, range(RUNS), BLOCK):
        if verdicts == "alone":
            states, *_ = monitors.verdicts(states, block.received, block.delivered)
        elif verdicts == "all":
            states, _ = monitors.run(states, block.received, block.delivered)

found = {"peer": min(seconds(peers) for _ in range(3)) * 1000 / PEERS}
for verdicts in ("none", "alone", "all"):
    found[verdicts] = min(seconds(lambda: ours(verdicts)) for _ in range(2)) * 1000 / RUNS
found["MB"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps(found))
"""
PARTS = (("grid", "none"), ("+ verdicts", "alone"), ("+ estimates, residuals", "all"))
RANDOM = [
    "noise={kind: gaussian, std: [0.01, 0.01, 0.001]}",
    *(f"dgus.{dgu}.load=[{{kind: uniform, low_a: 8.0, high_a: 16.0}}]" for dgu in range(6)),
]


@pytest.mark.parametrize(("loads", "overrides"), [("constant loads", []), ("noise, random loads", RANDOM)])
@pytest.mark.parametrize("engine", available())
def test_a_thousand_runs(engine: str, loads: str, overrides: list[str]) -> None:
    """The plant alone, with the verdicts of the monitors, with everything that they conclude."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", VARIABLE: engine}
    command = [sys.executable, "-c", MEASURE, json.dumps(overrides), "100" if engine == NUMPY else "1000"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=280, env=environment)
    found = json.loads(done.stdout)
    factors = "  ".join(f"{name} {found['peer'] / found[key]:5.1f} x" for name, key in PARTS)
    print(f"\n{engine:8} {loads:20} {factors}  of dlsim's {found['peer']:.1f} s; {found['MB']:.0f} MB", end="")  # noqa: T201
    assert found["peer"] > found["none"], "slower than a plant alone that is given its inputs"
