"""How well a replay into ROS keeps its times, and how fast it goes: `make bench` prints it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from itertools import pairwise
from statistics import median
from typing import TYPE_CHECKING, Any

import pytest

from bags.runs.offline import simulate_to_bag
from bags.watch.scenarios import load_scenario
from dcmg.shipped import scenario_path
from dcmg_bringup.domain import choose_domain

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.bench

_DURATION_SEC = 20
_DCMG = (sys.executable, "-m", "dcmg")

# Notes the time at which each tick arrives in another process.
_LISTENER = """
import json, sys, time
import rclpy
from dcmg_msgs.msg import Tick
from dcmg_nodes.executor import make_executor, spin_until
from dcmg_nodes.options import ExecutorKind
from rclpy.node import Node
from rclpy.task import Future

rclpy.init()
node, times, done, wanted = Node("listener"), [], Future(), int(sys.argv[1])

def on_tick(_data):
    times.append(time.monotonic())
    if len(times) == wanted:
        done.set_result(None)

subscription = node.create_subscription(Tick, "/tick", on_tick, 10, raw=True)
spin_until(make_executor(ExecutorKind.EVENTS, node), done, 100.0)
print(json.dumps(times))
"""


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twenty seconds of the six-DGU grid."""
    scenario = load_scenario(scenario_path("gallo_six_dgu"), [f"duration_sec={_DURATION_SEC}"])
    return simulate_to_bag(scenario, tmp_path_factory.mktemp("bench") / "run")


def _replayed(bag: Path, *options: str) -> tuple[dict[str, Any], list[float]]:
    """What the player says, and when each tick arrived."""
    with choose_domain() as domain:
        pass  # free, and nobody else takes it for a second
    listener = [sys.executable, "-c", _LISTENER, str(_DURATION_SEC * 100)]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
    with subprocess.Popen(listener, stdout=subprocess.PIPE, text=True, env=environment) as process:
        command = [*_DCMG, "replay", str(bag), "--publish", "--json", "--wait-for", "/tick", "--domain", str(domain)]
        done = subprocess.run([*command, *options], capture_output=True, text=True, check=True, timeout=100)
        times = json.loads(process.communicate(timeout=100)[0])
    document: dict[str, Any] = json.loads(done.stdout)
    return document, times


def _print(text: str) -> None:
    print(f"\n{text}", end="")  # noqa: T201 - what a bench is for


def test_times_at_rate_one(bag: Path) -> None:
    """All topics at rate 1: errors of the times between successive stamps, at the player and at a subscriber."""
    document, times = _replayed(bag, "--rate", "1")
    errors = sorted(abs(later - earlier - 0.01) for earlier, later in pairwise(times))
    at_player = document["timing"]["stamps"]
    _print(
        f"replay at rate 1, error of the times between steps: player median {at_player['median_sec'] * 1e3:.2f} ms, "
        f"99 % {at_player['p99_sec'] * 1e3:.2f} ms; subscriber median {median(errors) * 1e3:.2f} ms, "
        f"99 % {errors[len(errors) * 99 // 100] * 1e3:.2f} ms  (wanted: median at most 1 ms)"
    )
    assert len(times) == _DURATION_SEC * 100


def test_as_fast_as_it_goes(bag: Path) -> None:
    """All topics at rate max, one subscriber with a queue of ten: nothing is lost."""
    document, times = _replayed(bag, "--rate", "max")
    rate = document["messages"] / document["wall_sec"]
    _print(f"replay at rate max: {rate:.0f} messages/s, {_DURATION_SEC / document['wall_sec']:.1f} x real time")
    assert len(times) == _DURATION_SEC * 100


def test_live_monitors(bag: Path, tmp_path: Path) -> None:
    """Six live monitor nodes, a process each, at rate max: every conclusion equals the recorded one."""
    command = [*_DCMG, "replay", str(bag), "--publish", "--monitors", "--rate", "max", "--json", "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=200)
    document = json.loads(done.stdout)
    _print(f"replay at rate max with live monitors: {_DURATION_SEC / document['wall_sec']:.1f} x real time")
