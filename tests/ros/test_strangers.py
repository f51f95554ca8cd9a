"""Whoever speaks or listens in a run's ROS domain: the run is what it is without them, and speakers are named."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from mcap.reader import make_reader

from dcmg_bringup.domain import running_systems
from dcmg_bringup.ros_environment import ros_environment

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

HERE = Path(__file__).parent


def environment_of(out: Path) -> Mapping[str, str]:
    """Environment of a program in the public domain of a run."""
    domain = next(one.domain for one in running_systems() if one.out == str(out))
    return {**os.environ, **ros_environment(domain)}


def payloads(bag: Path) -> dict[str, list[bytes]]:
    """Payload bytes of every topic, in the order of the file."""
    found: dict[str, list[bytes]] = {}
    for path in sorted(bag.glob("*.mcap")):
        with path.open("rb") as stream:
            for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
                found.setdefault(channel.topic, []).append(message.data)
    return found


def assert_undisturbed(bag: Path, scenario: Path, steps: int, dcmg: Callable[..., Any], folder: Path) -> None:
    """Fail unless every topic of a bag begins as without ROS, and holds all steps."""
    simulated = dcmg("simulate", scenario, "--duration", f"{steps * 0.01:.2f}", "--no-plots", "--out", folder)
    assert simulated.code == 0, simulated.err
    expected, found = payloads(folder / "bag"), payloads(bag)
    assert set(found) == set(expected)
    for topic, messages in expected.items():
        shorter = min(len(messages), len(found[topic]))
        assert shorter in (len(messages), len(found[topic]))
        assert found[topic][:shorter] == messages[:shorter], topic
    assert len(found["/tick"]) >= steps


@pytest.mark.timeout(240)
def test_a_run_is_the_same_whoever_speaks_and_listens(
    start_run: Callable[..., Any], short_scenario: Path, dcmg: Callable[..., Any], tmp_path: Path
) -> None:
    """Every form on every topic, readers that sleep or are stopped, Ctrl-Z: the same payloads, and a name."""
    run = start_run(short_scenario, "--pacing", "realtime", "--duration", "600", "--json")
    run.wait_until_recording()
    environment = environment_of(run.out)
    listener = [sys.executable, str(HERE / "bystander.py"), str(short_scenario)]
    bystanders = [subprocess.Popen(listener, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    try:
        for bystander in bystanders:
            assert bystander.stdout is not None
            assert bystander.stdout.readline() == "listening\n"
        bystanders[1].send_signal(signal.SIGSTOP)
        run.process.send_signal(signal.SIGSTOP)
        command = [
            sys.executable,
            str(HERE / "storm.py"),
            str(short_scenario),
            "1",
        ]  # one is stopped
        storm = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, timeout=120)
        run.process.send_signal(signal.SIGCONT)
    finally:
        for bystander in bystanders:
            bystander.kill()
            bystander.wait()
    said = json.loads(storm.stdout)
    finished = run.end(signal.SIGINT)
    assert finished.code == 130, finished.err
    assert said["unmatched"] == []
    assert "stranger: /stray_program publishes on /" in finished.err
    assert "stranger: /stray_types (std_msgs/msg/String) publishes on /" in finished.err
    document = json.loads(finished.out)
    told = document["strangers"]
    heard = {one["topic"]: one["messages"] for one in told}
    assert heard.keys() == said["sent"].keys()
    assert {"/tick", "/dgu_1/state", "/dgu_2/received/dgu_1", "/run/end", "/diagnostics"} <= heard.keys()
    # a publisher of a short queue replaces its own messages before they leave: fewer may come than were sent
    assert {topic: n for topic, n in heard.items() if not 0 < n <= said["sent"][topic]} == {}
    assert_undisturbed(run.bag, short_scenario, document["steps"], dcmg, tmp_path / "simulated")
