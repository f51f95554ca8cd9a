"""Nodes that nobody supervises look after each other: whom they wait for, who is gone, who is there twice."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dcmg_msgs.msg import Ready

from dcmg_nodes.ports import CONTROL_QOS
from dcmg_nodes.wiring import PROGRESS, READY, RECORDER_NODE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rclpy.node import Node

    from dcmg_nodes.lifetime import Lifetime
    from dcmg_nodes.ports import Ports
    from dcmg_nodes.wiring import Wiring

_LOOK_SEC = 0.5
_SAY_SEC = 5.0
_GONE_SEC = 3.0  # longer than the news of the end of a run takes
_PROBE_SEC = 2.0
_TOLD_SEC = 2.0  # until the others have heard the same
_YOUNG_SEC = 60.0  # discovery takes less; what has run longer gives way to nobody, whatever a host's clock says


@dataclass(frozen=True, slots=True, kw_only=True)
class Patience:
    """How long a node that nobody supervises waits.

    Attributes:
        start_sec: for all nodes to be there [s].
        stall_sec: for the next step of a run that has begun [s].
    """

    start_sec: float
    stall_sec: float


def names_in_graph(node: Node) -> Counter[str]:
    """Names of all nodes that this one has discovered, itself included, and how often each is there."""
    return Counter(name for name, _ in node.get_node_names_and_namespaces())


def taken_names(node: Node, names: Sequence[str]) -> tuple[str, ...]:
    """Those of the names that other nodes of the domain have already; takes as long as discovery does."""
    deadline = time.monotonic() + _PROBE_SEC
    while time.monotonic() < deadline:
        there = names_in_graph(node)
        if found := tuple(name for name in names if there[name]):
            return found
        time.sleep(_LOOK_SEC / 10.0)
    return ()


class Companions:
    """Watches over the run from one process of it, by a timer; what is wrong ends the process with one line."""

    def __init__(self, ports: Sequence[Ports], wiring: Wiring, lifetime: Lifetime, patience: Patience) -> None:
        """Start to look around."""
        self._ports, self._wiring, self._lifetime, self._patience = ports, wiring, lifetime, patience
        self._publishers = {topic.name: topic.publishers[0] for topic in wiring.topics.all} | {PROGRESS: RECORDER_NODE}
        self._begun = self._moved = self._said = time.monotonic()
        self._before = self._progress()
        self._seen: set[str] = set()
        self._gone_since: dict[str, float] = {}
        self._stray, self._alike_until = "", self._begun
        self._since_ns = {one.name: one.since_ns for one in ports}
        self._older: set[str] = set()
        node = ports[0].node
        self._ready = node.create_subscription(Ready, READY, self._on_ready, CONTROL_QOS)
        self._timer = node.create_timer(_LOOK_SEC, self._look)

    def _on_ready(self, message: Ready) -> None:
        if message.since_ns < self._since_ns.get(message.node, 0):
            self._older.add(message.node)
        if message.run not in {"", self._wiring.run} and not self._is_running():
            self._stray = self._stray or f"{message.node} runs {message.run}"

    def _look(self) -> None:
        now, there = time.monotonic(), names_in_graph(self._ports[0].node)
        progress = self._progress()
        if progress != self._before:
            self._before, self._moved = progress, now
        trouble = self._other_run(now) or self._twice(there, now) or self._gone(there, now) or self._waiting(there, now)
        if trouble:
            self._lifetime.fail(self._ports[0].name, trouble)

    def _progress(self) -> int:
        return sum(one.progress() for one in self._ports)

    def _is_running(self) -> bool:
        return any(one.has_begun() for one in self._ports)

    def _other_run(self, now: float) -> str:
        if not self._stray:
            self._alike_until = now
        elif now - self._alike_until > _TOLD_SEC:
            return f"{self._stray}, and this node {self._wiring.run}: give all nodes the same scenario"
        return ""

    def _twice(self, there: Counter[str], now: float) -> str:
        """Before the run everybody ends; during it, whoever came later and did not find the others in time."""
        several = [name for name in self._wiring.nodes if there[name] > 1]
        if self._is_running():
            is_young = now - self._begun < _YOUNG_SEC
            several = [name for name in several if is_young and name in self._older]
        if not several:
            return ""
        return f"{_listed(several)} more than once in this ROS domain: another run? Set another ROS_DOMAIN_ID"

    def _gone(self, there: Counter[str], now: float) -> str:
        self._seen.update(name for name in self._wiring.nodes if there[name])
        for name in self._seen:
            if there[name]:
                self._gone_since.pop(name, None)
            elif now - self._gone_since.setdefault(name, now) > _GONE_SEC:
                return f"{name} is gone"
        return ""

    def _waiting(self, there: Counter[str], now: float) -> str:
        missing = [name for name in self._wiring.nodes if name not in self._seen]
        missing = missing or [name for name in self._wiring.nodes if not there[name]]
        if not self._is_running():
            left = self._begun + self._patience.start_sec - now
            what = _listed(missing) if missing else self._unmatched()
            if left < 0.0:
                return f"the run has not begun after {self._patience.start_sec:g} s: waits for {what}"
            if now - self._said > _SAY_SEC:
                self._said = now
                self._ports[0].log.info(f"waits for {what}; gives up in {left:.0f} s")
            return ""
        if now - self._moved > self._patience.stall_sec:
            return f"nothing came for {self._patience.stall_sec:g} s: waits for {self._awaited()}"
        return ""

    def _unmatched(self) -> str:
        late = [text for one in self._ports for text in one.unmatched()]
        return (
            f"nothing that it knows, but {'; '.join(late[:3])}: another scenario?" if late else "the clock's first tick"
        )

    def _awaited(self) -> str:
        topics = [name for one in self._ports for name in one.awaited()]
        own = {one.name for one in self._ports}
        nodes = dict.fromkeys(self._publishers.get(name, name) for name in topics)
        nodes = {name: None for name in nodes if name not in own} or nodes
        if not topics:
            return f"the end of the run, which {RECORDER_NODE} tells"
        return f"{_listed(list(nodes))} ({', '.join(topics[:3])})"


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names)
