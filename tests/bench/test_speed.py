"""How many times faster than real time each way to run the six-DGU grid is: `make bench` prints it."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.bench

# The rate is taken between two points of the run, so that starting processes and drawing plots is not in it.
RUN = """
import sys, time
from pathlib import Path
from dcmg_bringup.run_job import RunOptions, run_job
from dcmg.shipped import scenario_path
from bags.watch.scenarios import load_scenario

class Stopwatch:
    points = []
    def steps(self, complete):
        if complete and (not self.points or complete > self.points[-1][1]):
            self.points.append((time.monotonic(), complete))
    def alarm(self, line): pass

scenario = load_scenario(scenario_path("gallo_six_dgu"), ["duration_sec=" + sys.argv[2]])
outcome = run_job(scenario, Path(sys.argv[1]), RunOptions(composed=sys.argv[3] == "composed"), Stopwatch())
assert outcome.failure is None and not outcome.lost and outcome.steps == scenario.steps, outcome
(start, first), (end, last) = Stopwatch.points[0], Stopwatch.points[-1]
print((last - first) / (end - start))
"""


def report(name: str, steps_per_sec: float, wanted: float) -> None:
    """Print one line of the result."""
    factor = steps_per_sec * 0.01
    print(f"\n{name:34} {steps_per_sec:8.0f} steps/s  {factor:6.1f} x real time  (wanted: {wanted:g} x)", end="")  # noqa: T201


@pytest.mark.parametrize(("shape", "duration_sec", "wanted"), [("processes", 20, 2), ("composed", 40, 8)])
def test_lockstep_run(tmp_path: Path, shape: str, duration_sec: int, wanted: float) -> None:
    """Lockstep over ROS 2, everything recorded, nothing lost."""
    command = [sys.executable, "-c", RUN, str(tmp_path / "run"), str(duration_sec), shape]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=110)
    report(f"dcmg run, {shape}", float(done.stdout), wanted)


SIMULATE = """
import sys, time
from pathlib import Path
from bags.runs.offline import simulate_to_bag
from dcmg.shipped import scenario_path
from bags.watch.scenarios import load_scenario

scenario = load_scenario(scenario_path("gallo_six_dgu"), ["duration_sec=100"])
best = 0.0
for repeat in range(3):
    start = time.monotonic()
    simulate_to_bag(scenario, Path(sys.argv[1]) / str(repeat))
    best = max(best, scenario.steps / (time.monotonic() - start))
print(best)
"""


def test_simulate(tmp_path: Path) -> None:
    """The same run without ROS, recording included."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}  # as the command sets it
    command = [sys.executable, "-c", SIMULATE, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=110, env=environment)
    report("dcmg simulate", float(done.stdout), 50)
