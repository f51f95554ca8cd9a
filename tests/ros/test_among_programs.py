"""A good citizen among ROS programs: their arguments, their index, and what late listeners still hear."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import rclpy
from ament_index_python.packages import get_package_prefix, get_package_share_directory
from dcmg_msgs.msg import Alarm, AttackEvent
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile

from bags.ros_words import split_words
from tests.ros.conftest import run_dcmg

if TYPE_CHECKING:
    from collections.abc import Callable

LATE = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PREFIX = Path(sys.prefix)


@pytest.mark.parametrize(
    ("words", "ours", "for_ros"),
    [
        (["run", "x"], ["run", "x"], []),
        (["node", "a", "--ros-args", "-r", "__ns:=/x"], ["node", "a"], ["--ros-args", "-r", "__ns:=/x"]),
        (
            ["--ros-args", "--log-level", "info", "--", "run", "x"],
            ["run", "x"],
            ["--ros-args", "--log-level", "info", "--"],
        ),
        (["run", "--", "-x"], ["run", "--", "-x"], []),
        (["attach", "--", "a", "--ros-args", "-p", "b:=1"], ["attach", "--", "a", "--ros-args", "-p", "b:=1"], []),
        (
            ["--ros-args", "-p", "a:=1", "--", "attach", "--", "a"],
            ["attach", "--", "a"],
            ["--ros-args", "-p", "a:=1", "--"],
        ),
        (["run", "x", "--ros-args"], ["run", "x"], ["--ros-args"]),
    ],
)
def test_words_for_ros_are_told_from_ours(words: list[str], ours: list[str], for_ros: list[str]) -> None:
    """As `ros2 run` and `ros2 launch` append them."""
    assert split_words(words) == (ours, for_ros)


def test_a_run_takes_the_arguments_of_ros(tmp_path: Path) -> None:
    """Every command does; what ROS does not know is refused in one line."""
    quick = ("run", "isolated_dgu_1", "--duration", "0.1", "--no-plots", "--out", tmp_path / "run")
    assert run_dcmg(*quick, "--ros-args", "-r", "__ns:=/x", "-r", "__node:=y", "--log-level", "info").code == 0
    assert run_dcmg("scenarios", "--ros-args", "-r", "__ns:=/x").code == 0
    refused = run_dcmg(
        "node", "clock", "--scenario", "isolated_dgu_1", "--out", tmp_path / "node", "--ros-args", "--foo"
    )
    assert refused.code == 2
    assert refused.err.splitlines()[-1].startswith("dcmg: --ros-args --foo: expected arguments that ROS knows")


def test_the_packages_stand_in_the_index(monkeypatch: pytest.MonkeyPatch) -> None:
    """`ros2 run` and `ros2 launch` find the command and the launch file in the environment of wheels, too."""
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{PREFIX}{os.pathsep}{os.environ.get('AMENT_PREFIX_PATH', '')}")
    for package in ("dcmg_msgs", "dcmg_nodes", "dcmg_bringup"):
        assert get_package_prefix(package)
    share = Path(get_package_share_directory("dcmg_bringup"))
    assert (share / "launch" / "run.launch.py").is_file()
    assert os.access(Path(get_package_prefix("dcmg_bringup")) / "lib" / "dcmg_bringup" / "dcmg", os.X_OK)


def test_late_listeners_hear_alarms_and_attacks(start_run: Callable[..., Any]) -> None:
    """Whoever comes after an attack began hears that it did, and which monitor raised an alarm."""
    attack = "attacks=[{kind: bias, link: 1-2, bias: [0.1, 0.1, 0.1], start_sec: 2.5}]"
    run = start_run("gallo_six_dgu", "--duration", "600", "--set", attack)
    run.wait_until_recording()
    heard: dict[str, list[Any]] = {"alarms": [], "attacks": []}
    context = rclpy.Context()
    context.init(domain_id=run.domain)
    node = rclpy.create_node("late", context=context, enable_rosout=False)
    node.create_subscription(Alarm, "/dgu_2/alarms", heard["alarms"].append, LATE)
    node.create_subscription(AttackEvent, "/attacks/events", heard["attacks"].append, LATE)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        deadline = time.monotonic() + 60.0
        while not all(heard.values()) and time.monotonic() < deadline:
            executor.spin_once(timeout_sec=0.1)
    finally:
        executor.shutdown()
        context.shutdown()
        run.end(signal.SIGINT)
    assert [(one.source, one.monitor, one.active) for one in heard["alarms"]] == [(1, 2, True)]
    assert heard["attacks"]
