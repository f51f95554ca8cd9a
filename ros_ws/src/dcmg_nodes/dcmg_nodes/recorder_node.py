"""The recorder: writes every message of a run to a bag, in canonical order, and gives the clock its credit."""

from __future__ import annotations

import time
from functools import partial
from typing import TYPE_CHECKING

from dcmg_msgs.msg import NodeDone, Progress, RunEnd

from bags.mcap.topic import TopicKind
from dcmg_nodes.assembler import Arrival, Assembler
from dcmg_nodes.ports import CONTROL_OUT_QOS, CONTROL_QOS, Ports
from dcmg_nodes.second_publisher import SecondPublisherReaders
from dcmg_nodes.wiring import DONE, END, PROGRESS, RECORDER_NODE

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from bags.mcap.topic import Topic
    from bags.mcap.writer import BagWriter
    from dcmg_nodes.host import Host
    from dcmg_nodes.wiring import Wiring

CREDIT_EVERY = 4  # steps between two credits; must stay well below the clock's window
_WATCH_SEC = 0.25
_FLUSH_SEC = 0.5  # what a crash of this process may cost
_LINGER_SEC = 1.0
_LINGER_POLL_SEC = 0.02


class RecorderNode:
    """Records all topics; a run is over for it when it holds as many messages as were published."""

    def __init__(self, wiring: Wiring, host: Host, writer: BagWriter, steps: int, stall_timeout_sec: float) -> None:
        """Subscribe to every recorded topic."""
        self.ports = Ports(RECORDER_NODE, wiring, host)
        self._clock_topic = wiring.topics.clock().topic.name
        self._latched = [topic.name for topic in wiring.topics.all if topic.kind is TopicKind.LATCHED]
        self._writer = writer
        self._steps = steps
        self._stall_timeout_sec = stall_timeout_sec
        self._assembler = Assembler(wiring.topics)
        self._published: dict[str, int] = dict.fromkeys(self._assembler.counts, 0)
        self._announced = set(self._published)
        self._unfinished = set(wiring.nodes)
        self._credited = 0
        self._moved_at = self._flushed_at = time.monotonic()
        node = self.ports.node
        self._progress = node.create_publisher(Progress, PROGRESS, CONTROL_OUT_QOS)
        self._end = node.create_publisher(RunEnd, END, CONTROL_OUT_QOS)
        self._node_done = node.create_subscription(NodeDone, DONE, self._on_done, CONTROL_QOS)
        spoofable = {wiring.topics.received(link).topic.name: link for link in wiring.topics.links}
        expect = {}
        for topic in wiring.topics.all:
            on_other = None
            if topic.name in spoofable:
                on_other = partial(self._receive_second, topic)
                expect[spoofable[topic.name]] = partial(self._assembler.expect, topic)
            self.ports.subscribe(topic, partial(self._receive, topic), on_other)
        self._seconds = SecondPublisherReaders(self.ports, wiring.topics.links, expect)
        self._watch_timer = node.create_timer(_WATCH_SEC, self._watch)
        self.ports.ready_when(self._has_latched)
        self.ports.finish()
        self.ports.waits_for(self._overdue, lambda: self._assembler.complete)

    def close(self) -> None:
        """Write what is held of incomplete steps and close the bag."""
        try:
            self._write(self._assembler.drain())
        finally:  # a full disk must not leave the bag open
            self._writer.close()

    def _receive(self, topic: Topic, data: bytes) -> None:
        if topic.kind is TopicKind.LATCHED and self._assembler.complete:
            again = f"{topic.name}: said again during the run, by another node: left out"
            self.ports.log.warning(again)
            return
        self._take(self._assembler.push(topic, data))

    def _receive_second(self, topic: Topic, data: bytes) -> None:
        self._take(self._assembler.push_second(topic, data))

    def _take(self, arrivals: Sequence[Arrival]) -> None:
        if arrivals:
            self._write(arrivals)
            self._moved_at = time.monotonic()
            if self._assembler.complete - self._credited >= CREDIT_EVERY or self._assembler.complete == self._steps:
                self._credit()
        if not self._unfinished:
            self._end_when_all_arrived()

    def _write(self, arrivals: Iterable[Arrival]) -> None:
        for arrival in arrivals:
            if arrival.topic.name not in self._announced:
                self._announced.add(arrival.topic.name)
                self._writer.add_topic(arrival.topic)
            self._writer.write(arrival.topic.name, arrival.stamp_ns, arrival.data)

    def _credit(self, waiting_for: str = "", topic: str = "") -> None:
        self._credited = self._assembler.complete
        self._progress.publish(Progress(steps=self._credited, waiting_for=waiting_for, topic=topic))

    def _overdue(self) -> tuple[str, ...]:
        topic = self._assembler.overdue()
        return () if topic is None else (topic.name,)

    def _has_latched(self) -> bool:
        return all(self._assembler.counts[name] for name in self._latched)

    def _on_done(self, message: NodeDone) -> None:
        for topic, count in zip(message.topics, message.counts, strict=True):
            self._published[topic] = self._published.get(topic, 0) + count
        self._unfinished.discard(message.node)
        if not self._unfinished:
            self._end_when_all_arrived()

    def _end_when_all_arrived(self) -> None:
        if self._assembler.counts == self._published:
            self._finish(lost=0)

    def _finish(self, lost: int) -> None:
        self._unfinished.add(RECORDER_NODE)  # nothing that comes now can end the run again
        self.close()
        for name, number in self._writer.dropped.items():
            loss = f"{number} message(s) of {name} were not recorded: the disk was too slow"
            self.ports.log.error(loss)
        lost += sum(self._writer.dropped.values())
        self._end.publish(RunEnd(steps=self._assembler.complete, lost=lost))
        self._leave_by = time.monotonic() + _LINGER_SEC
        self._linger_timer = self.ports.node.create_timer(_LINGER_POLL_SEC, self._leave_when_alone)

    def _leave_when_alone(self) -> None:
        """Stay until the nodes of other processes have heard the end and are gone."""
        here = self.ports.lifetime.nodes - 1
        if self._end.get_subscription_count() <= here or time.monotonic() > self._leave_by:
            self.ports.lifetime.leave(RECORDER_NODE)

    def _watch(self) -> None:
        """Credit stragglers, put what is written on the disk, and name what a stalled run waits for."""
        if time.monotonic() - self._flushed_at > _FLUSH_SEC:
            self._writer.flush()
            self._flushed_at = time.monotonic()
        if self._assembler.complete != self._credited:
            self._credit()
        started = self._assembler.counts[self._clock_topic] > 0
        if not started or time.monotonic() - self._moved_at < self._stall_timeout_sec:
            return
        if not self._unfinished:
            arrived = self._assembler.counts
            lost = {name: count - arrived.get(name, 0) for name, count in self._published.items()}
            for name, number in lost.items():
                if number:
                    loss = f"{number} message(s) of {name} were published and did not arrive"
                    self.ports.log.error(loss)
            self._finish(lost=sum(lost.values()))
        elif (topic := self._assembler.overdue()) is not None and self._assembler.complete < self._steps:
            self._credit(waiting_for=topic.publishers[0], topic=topic.name)
            self._moved_at = time.monotonic()
