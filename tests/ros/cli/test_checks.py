"""A run as ROS users see it: thirty commands of a real `ros2`, where one is installed, and rclpy asked the same."""

from __future__ import annotations

import ast
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import rclpy
from ament_index_python.packages import get_package_share_directory
from dcmg_msgs.srv import ListAttacks, StopAttack
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import QoSProfile
from rclpy.task import Future

from dcmg_nodes.ports import message_class
from tests.ros.cli.checks import CHECKS, Ask, Check
from tests.ros.conftest import Background, background_run

if TYPE_CHECKING:
    from collections.abc import Iterator

_ANSWER_SEC = 20.0
LAUNCH = Path(__file__).parents[3] / "ros_ws" / "src" / "dcmg_bringup" / "launch" / "run.launch.py"


@pytest.fixture(name="run", scope="module")
def _run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Background]:
    """Six DGUs at the pace of the wall clock."""
    out = tmp_path_factory.mktemp("cli") / "run"
    with background_run(out, "gallo_six_dgu", "--pacing", "realtime", "--duration", "600") as run:
        run.wait_until_recording()
        yield run
        assert run.end(signal.SIGINT).code == 130


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.words)
def test_the_command_line_says_what_is_expected(check: Check, run: Background) -> None:
    """Of a full ROS installation."""
    if shutil.which("ros2") is None:
        pytest.skip("no ros2 command on this machine: the next test asks rclpy")
    environment = {**os.environ, "ROS_DOMAIN_ID": str(run.domain)}
    command = ["ros2", *shlex.split(check.words)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60.0, check=False)
    for pattern in check.patterns:
        assert re.search(pattern.replace(" ", r"\s+"), done.stdout + done.stderr), done.stdout + done.stderr


@pytest.fixture(name="outsider", scope="module")
def _outsider(run: Background) -> Iterator[Outsider]:
    outsider = Outsider(run.domain)
    yield outsider
    outsider.close()


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.words)
def test_rclpy_says_the_same(check: Check, outsider: Outsider, monkeypatch: pytest.MonkeyPatch) -> None:
    """Names, types, counts, values and texts are those that `ros2` is expected to print."""
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{sys.prefix}{os.pathsep}{os.environ.get('AMENT_PREFIX_PATH', '')}")
    deadline, missing = time.monotonic() + _ANSWER_SEC, list(check.patterns)
    while missing and time.monotonic() < deadline:  # discovery takes a moment
        said = outsider.asked(check)
        missing = [one for one in check.patterns if not re.search(one.replace(" ", r"\s+"), said)]
    assert missing == [], said


def test_there_are_thirty() -> None:
    """Of topics, nodes, services, parameters, interfaces and launch files."""
    assert len(CHECKS) == 30
    kinds = {check.words.split()[0] for check in CHECKS}
    assert kinds == {"interface", "launch", "node", "param", "service", "topic"}


class Outsider:
    """A node of the run's public domain, which asks what `ros2` asks."""

    def __init__(self, domain: int) -> None:
        """Join it."""
        self._context = rclpy.Context()
        self._context.init(domain_id=domain)
        self._node = rclpy.create_node("outsider", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._clients: dict[str, AsyncParameterClient] = {}

    def close(self) -> None:
        """Leave."""
        self._executor.shutdown()
        self._context.shutdown()

    def asked(self, check: Check) -> str:
        """Answer as text."""
        self._executor.spin_once(timeout_sec=0.05)
        answers = {
            Ask.NODES: self._nodes,
            Ask.NODE: self._of_node,
            Ask.TOPICS: self._topics,
            Ask.TOPIC_TYPE: lambda topic: str(dict(self._node.get_topic_names_and_types()).get(topic)),
            Ask.TOPIC_ENDS: self._ends,
            Ask.ECHO: self._echo,
            Ask.SERVICES: lambda: str(self._node.get_service_names_and_types()),
            Ask.SERVICE_TYPE: lambda name: str(dict(self._node.get_service_names_and_types()).get(name)),
            Ask.CALL: self._call,
            Ask.LIST_PARAMETERS: lambda node: str(self._done(self._of(node).list_parameters())),
            Ask.GET_PARAMETER: lambda node, name: str(self._done(self._of(node).get_parameters([name]))),
            Ask.DESCRIBE_PARAMETER: lambda node, name: str(self._done(self._of(node).describe_parameters([name]))),
            Ask.SET_PARAMETER: self._set,
            Ask.INTERFACE: _interface,
            Ask.LAUNCH: _arguments,
        }
        answer: Any = answers[check.ask]
        return str(answer(*check.about))

    def _nodes(self) -> str:
        return "\n".join(f"{space.rstrip('/')}/{name}" for name, space in self._node.get_node_names_and_namespaces())

    def _of_node(self, name: str) -> str:
        try:
            found = self._node.get_publisher_names_and_types_by_node(name, "/")
            found += self._node.get_service_names_and_types_by_node(name, "/")
        except Exception as error:  # noqa: BLE001 - rclpy's own for a node that it does not know yet
            return str(error)
        return "\n".join(f"{topic}: {', '.join(types)}" for topic, types in found)

    def _topics(self) -> str:
        return "\n".join(f"{topic} [{', '.join(types)}]" for topic, types in self._node.get_topic_names_and_types())

    def _ends(self, topic: str) -> str:
        ends = self._node.get_publishers_info_by_topic(topic)
        told = (
            f"Node name: {end.node_name} {end.qos_profile.reliability.name} {end.qos_profile.durability.name}"
            for end in ends
        )
        return f"Publisher count: {len(ends)}\n" + "\n".join(told)

    def _echo(self, topic: str) -> str:
        types = dict(self._node.get_topic_names_and_types()).get(topic)
        if not types:
            return "unknown"
        heard: Future = Future()
        kind = message_class(types[0])
        subscription = self._node.create_subscription(
            kind, topic, lambda message: heard.done() or heard.set_result(message), QoSProfile(depth=10)
        )
        message = self._done(heard)
        self._node.destroy_subscription(subscription)
        fields = re.sub(r"(\w+)=", r"\1: ", str(message))
        return fields.replace("True", "true")

    def _call(self, what: str) -> str:
        kind, request = (ListAttacks, ListAttacks.Request())
        if what == "stop":
            kind, request = StopAttack, StopAttack.Request(source=5, target=6)
        client = self._node.create_client(kind, f"/attacks/{what}")
        if not client.wait_for_service(_ANSWER_SEC):
            return "no service"
        answer = str(self._done(client.call_async(request)))
        self._node.destroy_client(client)
        return answer

    def _of(self, node: str) -> AsyncParameterClient:
        if node not in self._clients:
            self._clients[node] = AsyncParameterClient(self._node, node)
        assert self._clients[node].wait_for_services(_ANSWER_SEC)
        return self._clients[node]

    def _set(self, node: str, name: str) -> str:
        return str(self._done(self._of(node).set_parameters([Parameter(name, value=7)])))

    def _done(self, future: Future) -> object:
        self._executor.spin_until_future_complete(future, timeout_sec=_ANSWER_SEC)
        return future.result()


def _interface(file: str = "") -> str:
    share = Path(get_package_share_directory("dcmg_msgs"))
    if file:
        return (share / file).read_text()
    return "\n".join(f"dcmg_msgs/msg/{path.stem}" for path in (share / "msg").glob("*.msg"))


def _arguments() -> str:
    """Read the arguments of the launch file, which cannot be run without launch."""
    for line in ast.parse(LAUNCH.read_text()).body:
        if isinstance(line, ast.Assign) and getattr(line.targets[0], "id", "") == "ARGUMENTS":
            return str(ast.literal_eval(line.value))
    return ""
