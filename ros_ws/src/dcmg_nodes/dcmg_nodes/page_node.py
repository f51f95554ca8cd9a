"""A bystander that hears what the page shows of a run, and calls the attacker for it."""

from __future__ import annotations

import json
import threading
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING, Any

import rclpy
from dcmg_msgs.msg import Pacing, RunEnd
from dcmg_msgs.srv import StartAttack, StopAttack
from rclpy.node import Node
from rclpy.task import Future

from dcmg_nodes.executor import make_executor, spin_until
from dcmg_nodes.farewell import destroy
from dcmg_nodes.options import ExecutorKind
from dcmg_nodes.ports import CONTROL_QOS, data_qos, message_class
from dcmg_nodes.ros_arguments import ros_arguments
from dcmg_nodes.wiring import END, PACING

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from bags.mcap.topic import Topic
    from dgu_sim.grid import Link

_TICK_SEC = 0.05
_ANSWER_SEC = 3.0


class PageNode:
    """Collects payloads until they are taken; to be closed.

    Args:
        topics: what is heard.
        tick: called twenty times a second, between messages.
    """

    def __init__(self, topics: Sequence[Topic], tick: Callable[[], None]) -> None:
        """Join the domain of the environment; nothing is dispatched before `spin`."""
        self.payloads: dict[str, list[bytes]] = {topic.name: [] for topic in topics}
        self.deadline_misses, self.end = 0, False
        self._stack = ExitStack()
        context = rclpy.Context()
        context.init(args=ros_arguments())
        self._stack.callback(context.try_shutdown)
        self._node = Node("dcmg_page", context=context, enable_rosout=False, start_parameter_services=False)
        self._stack.callback(destroy, self._node, 1)
        create = self._node.create_subscription
        for topic in topics:
            create(
                message_class(topic.type_name), topic.name, partial(self._take, topic.name), data_qos(topic), raw=True
            )
        create(Pacing, PACING, self._on_pacing, CONTROL_QOS)
        create(RunEnd, END, self._on_end, CONTROL_QOS)
        self._start = self._node.create_client(StartAttack, "/attacks/start")
        self._stop = self._node.create_client(StopAttack, "/attacks/stop")
        self._node.create_timer(_TICK_SEC, tick)
        self._over: Future = Future()

    def spin(self) -> None:
        """Dispatch until `close`."""
        executor = make_executor(ExecutorKind.EVENTS, self._node)
        try:
            spin_until(executor, self._over)
        finally:
            executor.shutdown()

    def leave(self) -> None:
        """Let `spin` return."""
        if not self._over.done():
            self._over.set_result(None)

    def close(self) -> None:
        """Leave the ROS graph, once `spin` has returned."""
        self._stack.close()

    def start(self, link: Link, kind: str, parameters: Mapping[str, object], duration_sec: float) -> tuple[int, int]:
        """Return number and first step of an attack; TimeoutError without an answer, ValueError where it is refused."""
        told = json.dumps(parameters)
        request = StartAttack.Request(
            source=link.source, target=link.target, kind=kind, parameters=told, duration_sec=duration_sec
        )
        answer = self._call(self._start, request)
        return answer.attack, answer.step

    def stop(self, link: Link) -> tuple[int, int]:
        """Return how many attacks were stopped and the first clean step; raises what `start` does."""
        answer = self._call(self._stop, StopAttack.Request(source=link.source, target=link.target))
        return answer.stopped, answer.step

    def _call(self, client: Any, request: Any) -> Any:  # noqa: ANN401 (generated classes share no base)
        """Ask from another thread than the one that spins."""
        if not client.service_is_ready():
            raise TimeoutError
        answered = threading.Event()
        future = client.call_async(request)
        future.add_done_callback(lambda _: answered.set())
        if not answered.wait(_ANSWER_SEC):
            raise TimeoutError
        answer = future.result()
        if not answer.accepted:
            raise ValueError(answer.message)
        return answer

    def _take(self, name: str, data: bytes) -> None:
        self.payloads[name].append(data)

    def _on_pacing(self, message: Pacing) -> None:
        self.deadline_misses = message.deadline_misses

    def _on_end(self, _: RunEnd) -> None:
        self.end = True
