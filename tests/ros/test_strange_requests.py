"""Services called with anything: the attacker refuses and goes on."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Any

import pytest
import rclpy
from dcmg_msgs.srv import StartAttack, StopAttack
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dgu_sim.attacks import KINDS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from rclpy.node import Node

STRANGE = (
    {"kind": "bias", "parameters": '{"\\ud800":1}'},
    {"kind": "bias", "parameters": "[" * 3000},
    {"kind": "bias", "parameters": '{"bias": [' + "9" * 5000 + ", 0, 0]}"},
    {"kind": "bias", "parameters": '{"bias": [1' + "0" * 400 + ", 0, 0]}"},
    {"kind": "delay", "parameters": '{"delay_sec": 1e308}'},
    {"kind": "bias", "parameters": '{"links": [["1-2"]], "bias": [1, 1, 1]}'},
    {"kind": "", "parameters": "", "duration_sec": float("nan")},
    {"kind": "bias\n", "parameters": '{"bias": [1, 1, 1]}', "duration_sec": 1e308, "source": 2**32 - 1},
)


@pytest.fixture
def caller(start_run: Callable[..., Any], long_scenario: Path) -> Iterator[tuple[Any, Node]]:
    """A composed run and a node in its domain."""
    run = start_run(long_scenario, "--composed", "--pacing", "realtime")
    run.wait_until_recording()
    domain = run.domain
    context = rclpy.Context()
    profile = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "ROS_DOMAIN_ID": str(domain)}
    before = {name: os.environ.get(name) for name in profile}
    os.environ.update(profile)
    context.init(domain_id=domain)
    node = rclpy.create_node("stranger", context=context)
    yield run, node
    node.destroy_node()
    context.shutdown()
    for name, value in before.items():
        os.environ.pop(name) if value is None else os.environ.update({name: value})


def call(node: Node, kind: type[Any], name: str, request: object) -> Any:  # noqa: ANN401 (generated response)
    """Call a service and wait for its answer."""
    client = node.create_client(kind, name)
    assert client.wait_for_service(timeout_sec=30.0)
    future = client.call_async(request)
    executor = rclpy.executors.SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    executor.spin_until_future_complete(future, timeout_sec=30.0)
    executor.shutdown()
    node.destroy_client(client)
    assert future.done(), "no answer: the attacker has ended"
    return future.result()


def test_no_request_ends_the_attacker(caller: tuple[Any, Node]) -> None:
    """Each strange request is refused with a reason; afterwards a sound one is served and the run goes on."""
    run, node = caller
    for strange in STRANGE:
        request = StartAttack.Request(**{"source": 1, "target": 2, **strange})
        answer = call(node, StartAttack, "/attacks/start", request)
        assert not answer.accepted
        assert answer.message
    assert not call(node, StopAttack, "/attacks/stop", StopAttack.Request(source=2**32 - 1, target=0)).accepted
    sound = StartAttack.Request(source=1, target=2, kind="bias", parameters='{"bias": [0.1, 0.1, 0.1], "anyway": true}')
    assert call(node, StartAttack, "/attacks/start", sound).accepted
    assert run.process.poll() is None


_WORDS = st.one_of(
    st.sampled_from(["1-2", "bias", "links", "kind", "", "nan", "\ud800", "9" * 400]), st.text(max_size=20)
)
_JSON = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), _WORDS),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(_WORDS, inner, max_size=4)),
    max_leaves=8,
)
_PARAMETERS = st.one_of(
    st.text(max_size=60),
    st.dictionaries(st.one_of(_WORDS, st.sampled_from(["bias", "gain", "delay_sec"])), _JSON, max_size=4).map(
        json.dumps
    ),
    st.lists(st.floats(), min_size=3, max_size=3).map(lambda bias: json.dumps({"bias": bias, "anyway": True})),
)
_NUMBER = st.integers(0, 2**32 - 1)


@settings(max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    kind=st.one_of(st.sampled_from(sorted(KINDS)), _WORDS),
    parameters=_PARAMETERS,
    link=st.one_of(st.sampled_from([(1, 2), (4, 3)]), st.tuples(_NUMBER, _NUMBER)),
    duration_sec=st.floats(),
)
def test_any_request_is_answered(
    caller: tuple[Any, Node], kind: str, parameters: str, link: tuple[int, int], duration_sec: float
) -> None:
    """Whatever a program asks for, it gets an answer, with a reason where it is refused; the run goes on."""
    run, node = caller
    source, target = link
    words = [word.encode("utf-8", "replace").decode().replace("\0", "") for word in (kind, parameters)]
    request = StartAttack.Request(
        source=source, target=target, kind=words[0], parameters=words[1], duration_sec=duration_sec
    )
    answer = call(node, StartAttack, "/attacks/start", request)
    assert answer.accepted or answer.message
    call(node, StopAttack, "/attacks/stop", StopAttack.Request(source=source, target=target))
    assert run.process.poll() is None
