"""A second publisher on the wire, planned, by hand and from outside."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from mcap.reader import make_reader

from bags import golden
from bags.runs.reader import read_run
from bags.runs.replay import replay
from bags.watch.scenarios import load_scenario
from dcmg_bringup.ros_environment import ros_environment
from dgu_sim.grid import Link

if TYPE_CHECKING:
    from collections.abc import Callable

GOLDEN_SCENARIO = Path(golden.__file__).with_name("three_dgus.yaml")
HIDE = "poison=[{kind: hide, dgu: 1, bias: [0, 0.5, 0]}]"
FALSIFY = "{kind: bias, bias: [0, 0.5, 0]}"
DETECTOR = "monitor.detector.options={settle_sec: 0.1, calibrate_sec: 0.2}"

# An outsider: a publisher that belongs to nobody's run, sending nonsense on a received topic until it is ended.
OUTSIDER = """
import rclpy, time
from dcmg_msgs.msg import Output
from rclpy.qos import QoSProfile, ReliabilityPolicy
rclpy.init()
node = rclpy.create_node("outsider")
publisher = node.create_publisher(Output, "/dgu_1/received/dgu_3", QoSProfile(depth=10))
while publisher.get_subscription_count() < 3:
    time.sleep(0.01)
message = Output(step=3, source=2, delivered=True, y=[1.0, 2.0, 3.0])
message.header.frame_id = "nobody knows"
for _ in range(200):
    publisher.publish(message)
    time.sleep(0.01)
"""


def messages(bag: Path) -> list[tuple[str, int, bytes]]:
    """Topic, stamp and payload of every message in the order of the file."""
    (path,) = bag.glob("*.mcap")
    with path.open("rb") as stream:
        found = make_reader(stream).iter_messages(log_time_order=False)
        return [(channel.topic, message.log_time, message.data) for _, channel, message in found]


@pytest.fixture(name="write_scenario")
def _write_scenario(tmp_path: Path) -> Callable[..., Path]:
    """Write a variant of the golden bags' scenario of three DGUs."""

    def write(*overrides: str) -> Path:
        path = tmp_path / "scenario.yaml"
        path.write_text(load_scenario(GOLDEN_SCENARIO, (DETECTOR, *overrides)).to_yaml())
        return path

    return write


def test_processes_and_simulation_write_the_same_spoofed_bag(
    dcmg: Callable[..., Any], write_scenario: Callable[..., Path], tmp_path: Path
) -> None:
    """Over ROS a second publisher sends; the bag has every byte in the place where the run without ROS has it."""
    spoof = f"{{kind: spoof, links: [1-2, 3-1], start_sec: 0.5, stop_sec: 0.8, falsify: {FALSIFY}}}"
    again = "{kind: spoof, link: 1-2, start_sec: 0.8, falsify: {kind: freeze}}"
    scenario = write_scenario("duration_sec=1", f"attacks=[{spoof}, {again}]", HIDE)
    bags = []
    for command in ("run", "simulate"):
        finished = dcmg(command, scenario, "--no-plots", "--json", "--out", tmp_path / command)
        assert finished.code == 0, finished.err
        bags.append(messages(tmp_path / command / "bag"))
    assert bags[0] == bags[1]
    assert sum(topic.endswith("/second_publisher") for topic, _, _ in bags[0]) == 2 * 30 + 20


def test_spoofed_by_hand_and_by_an_outsider(
    start_run: Callable[..., Any], dcmg: Callable[..., Any], write_scenario: Callable[..., Path]
) -> None:
    """A spoof by service steers its receiver from start to stop; a stranger is named, and taken by nobody."""
    run = start_run(write_scenario("duration_sec=600", "attacks=[]"), "--pacing", "realtime")
    run.wait_until_recording()
    domain = run.domain
    here = ("--domain", str(domain))
    started = dcmg("attack", "start", "spoof", "1-2", "--falsify", FALSIFY, "--anyway", *here)
    assert started.code == 0, started.err
    (listed,) = json.loads(dcmg("attack", "list", "--json", *here).out)
    assert listed["kind"] == "spoof"
    environment = {**os.environ, **ros_environment(domain)}
    subprocess.run([sys.executable, "-c", OUTSIDER], env=environment, check=True, timeout=60)
    stopped = dcmg("attack", "stop", "1-2", *here)
    assert stopped.code == 0, stopped.err
    finished = run.end(signal.SIGINT)
    assert finished.code == 0
    assert "stranger: /outsider publishes on /dgu_1/received/dgu_3" in finished.err

    first, last = (int(one.out.split("step ")[1].split()[0]) for one in (started, stopped))
    record = read_run(run.bag)
    ours = [one for one in record.seconds if one.link == Link(1, 2)]
    assert [one.step for one in ours] == list(range(first, last))
    link = record.links.index(Link(1, 2))
    np.testing.assert_array_equal(record.received[first:last, link], record.y[first:last, 0] + [0.0, 0.5, 0.0])
    np.testing.assert_array_equal(record.received[:first, link], record.y[:first, 0])
    strange = record.links.index(Link(3, 1))
    np.testing.assert_array_equal(record.received[:, strange], record.y[:, 2])
    told = {(one.source, one.monitor, one.kind) for one in record.streams}
    assert told == {(1, 2, "second_publisher")}
    np.testing.assert_array_equal(replay(record).residual, record.residual)
