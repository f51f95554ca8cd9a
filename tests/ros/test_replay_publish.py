"""Recorded runs published into ROS again."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from mcap.reader import make_reader

from bags.golden import golden_path
from bags.mcap.bag import open_bag
from dcmg_bringup.domain import running_systems

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

# Counts on a queue of ten, the default of ROS 2, and writes down what came in which order.
_LISTENER = """
import json, sys, time
import rclpy
from dcmg_msgs.msg import History, Output
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock

rclpy.init()
node = Node("listener", enable_rosout=False, start_parameter_services=False)
found = {"/lab/output": [], "/clock": [], "/dgu_1/history": []}
latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
subscriptions = [
    node.create_subscription(kind, name, lambda data, name=name: found[name].append(data.hex()), qos, raw=True)
    for kind, name, qos in ((Output, "/lab/output", 10), (Clock, "/clock", 10), (History, "/dgu_1/history", latched))
]
wanted, until = int(sys.argv[1]), time.monotonic() + 60.0
while time.monotonic() < until and not (len(found["/lab/output"]) >= wanted <= len(found["/clock"])):
    rclpy.spin_once(node, timeout_sec=0.1)
print(json.dumps(found))
"""


def _wait_until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < deadline, "the awaited condition did not come true"
        time.sleep(0.02)  # the pace of polling, not a wait


def _payloads(bag: Path, topic: str) -> list[str]:
    found = []
    for path in sorted(bag.glob("*.mcap")):
        with path.open("rb") as stream:
            found += [m.data.hex() for _, _, m in make_reader(stream).iter_messages([topic], log_time_order=False)]
    return found


@contextmanager
def _listener(domain: int, wanted: int) -> Iterator[subprocess.Popen[str]]:
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
    command = [sys.executable, "-c", _LISTENER, str(wanted)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        try:
            yield process
        finally:
            process.kill()


def test_live_monitors_repeat_the_residuals(
    short_runs: Mapping[str, tuple[Path, Any]], dcmg: Callable[..., Any], tmp_path: Path
) -> None:
    """Monitor nodes, a process each, on the published data of a run: every message of theirs is the recorded one."""
    bag, _ = short_runs["processes"]
    done = dcmg("replay", bag, "--publish", "--monitors", "--rate", "max", "--json", "--out", tmp_path)
    assert done.code == 0, done.err
    live = json.loads(done.out)["live"]
    residuals = {name: counts for name, counts in live.items() if "/residual/" in name}
    assert len(residuals) == 14
    assert all(counts == {"equal": 200, "different": 0} for counts in residuals.values())
    assert all(counts["different"] == 0 for counts in live.values())
    assert live["/dgu_2/alarms"]["equal"] > 0


def test_listeners_of_any_kind_get_everything(
    short_runs: Mapping[str, tuple[Path, Any]], dcmg: Callable[..., Any], free_domain: int
) -> None:
    """A subscriber with a queue of ten gets every message as fast as the player goes, from the first on, in order."""
    bag, _ = short_runs["simulated"]
    sent = _payloads(bag, "/dgu_1/output")
    domain = free_domain
    with _listener(domain, len(sent)) as listener:
        chosen = ("--topics", "/dgu_1/.*", "--topics", "/clock", "--exclude", ".*/state")
        names = ("--remap", "/dgu_1/output:=/lab/output", "--wait-for", "/dgu_1/output", "--wait-for", "/clock")
        done = dcmg("replay", bag, "--publish", "--rate", "max", "--domain", domain, "--json", *chosen, *names)
        found = json.loads(listener.communicate(timeout=90.0)[0])
    assert done.code == 0, done.err
    assert found["/lab/output"] == sent
    assert found["/clock"] == _payloads(bag, "/clock")
    assert found["/dgu_1/history"] == _payloads(bag, "/dgu_1/history")
    document = json.loads(done.out)
    assert "/dgu_1/state" not in document["topics"]
    assert document["left_out"] == {}


def test_a_replay_is_steered_from_elsewhere(dcmg: Callable[..., Any], free_domain: int) -> None:
    """Started paused, a replay goes on by three steps when told to, and to its end when told to."""
    domain = free_domain
    bag = golden_path("biased")
    command = [
        sys.executable,
        "-m",
        "dcmg",
        "replay",
        str(bag),
        "--publish",
        "--paused",
        "--rate",
        "max",
        "--domain",
        str(domain),
        "--json",
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            _wait_until(lambda: any(system.domain == domain for system in running_systems()))
            stepped = dcmg("player", "step", "3", "--domain", domain)
            assert stepped.code == 0, stepped.err
            _wait_until(lambda: dcmg("player", "status", "--domain", domain).out.startswith("t = 0.02 s"))
            resumed = dcmg("player", "resume", "--domain", domain)
            assert resumed.code == 0, resumed.err
            out, err = process.communicate(timeout=60.0)
        finally:
            process.kill()
    assert process.returncode == 0, err
    document = json.loads(out)
    assert document["messages"] == sum(topic.count for topic in open_bag(bag).topics.values())
    assert not document["interrupted"]
