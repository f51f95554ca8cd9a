"""Messages in any order of arrival → complete steps in canonical order."""

from __future__ import annotations

import struct
from collections import deque
from typing import TYPE_CHECKING, NamedTuple

from bags.mcap.topic import TopicKind
from bags.wire.stream import claimed_step
from dcmg_nodes.intake import expects

if TYPE_CHECKING:
    from bags.mcap.topic import Topic
    from bags.wire.schema import RunTopics

_NANOSECONDS = 1_000_000_000
_STAMP = struct.Struct("<iI")


# A member of an enum is looked up anew each time it is named: too slow for every message.
_PER_STEP, _LATCHED = TopicKind.PER_STEP, TopicKind.LATCHED


class Arrival(NamedTuple):
    """CDR bytes of one message and the topic they came on."""

    topic: Topic
    data: bytes
    filed_ns: int | None = None

    @property
    def stamp_ns(self) -> int:
        """Stamp that our messages, and /clock, all begin with [ns]; of a stranger's message, when it came."""
        if self.filed_ns is not None:
            return self.filed_ns
        sec, nanosec = _STAMP.unpack_from(self.data, 4)
        stamp_ns: int = sec * _NANOSECONDS + nanosec
        return stamp_ns

    @property
    def frame_id(self) -> str:
        """Second field of the header; "" of a stranger's message, which may be anything."""
        if self.filed_ns is not None:
            return ""
        (length,) = struct.unpack_from("<I", self.data, 12)
        return self.data[16 : 15 + length].decode()


class Assembler:
    """Holds the messages of step k until they are all there.

    The order within a step is that of `RunTopics.all`, events behind the per-step messages of their step; latched
    messages stand before step 0. Alarms and attack events are not announced, so one that arrives after its step was
    written stands behind a later step; its stamp tells.
    """

    def __init__(self, topics: RunTopics) -> None:
        """Start with nothing received."""
        self._period_ns = topics.sampling_period_ns
        self._order = {topic.name: rank for rank, topic in enumerate(topics.all)}
        self._per_step = topics.per_step
        self._held: dict[str, deque[bytes]] = {topic.name: deque() for topic in self._per_step}
        self._latched: list[Arrival] = []
        self._events: dict[int, list[Arrival]] = {}
        self._diagnostics = topics.diagnostics(topics.monitors[0]) if topics.monitors else None
        self._arrived: dict[int, int] = {}
        self._seconds = {topics.received(link).topic.name: topics.second(link) for link in topics.links}
        self._order |= {codec.topic.name: self._order[name] for name, codec in self._seconds.items()}
        self._spans: dict[str, dict[int, int]] = {}
        self.counts: dict[str, int] = {topic.name: 0 for topic in topics.all}
        self.complete = 0
        self._wanted = self._expected(0)

    def push(self, topic: Topic, data: bytes) -> list[Arrival]:
        """Take one message; return those of every step that is complete now."""
        count = self.counts[topic.name]
        self.counts[topic.name] = count + 1
        if topic.kind is _PER_STEP:
            self._held[topic.name].append(data)
            step = count
        elif topic.kind is _LATCHED:
            self._latched.append(Arrival(topic, data))
            return []
        else:
            arrival = Arrival(topic, data)
            step = max(arrival.stamp_ns // self._period_ns, self.complete)
            self._events.setdefault(step, []).append(arrival)
            if self._diagnostics is None or topic.name != self._diagnostics.topic.name:
                return []
        self._arrived[step] = self._arrived.get(step, 0) + 1
        if step != self.complete or self._arrived[step] < self._wanted:
            return []
        return self._take_complete()

    def expect(self, topic: Topic, first_step: int, end_step: int) -> None:
        """Wait for a second message on a received topic at the steps [first_step, end_step)."""
        self._spans.setdefault(topic.name, {})[first_step] = end_step
        self._wanted = self._expected(self.complete)

    def push_second(self, topic: Topic, data: bytes) -> list[Arrival]:
        """Take a message of another publisher on a received topic; return those of every step that is complete now."""
        codec = self._seconds[topic.name]
        step = claimed_step(codec, data)
        if not expects(self._spans.get(topic.name, {}), step):
            stranger = Arrival(codec.topic, data, filed_ns=self.complete * self._period_ns)
            self._events.setdefault(self.complete, []).append(stranger)
            return []
        name = codec.topic.name
        self.counts[name] = self.counts.get(name, 0) + 1
        self._events.setdefault(step, []).append(Arrival(codec.topic, data))
        self._arrived[step] = self._arrived.get(step, 0) + 1
        return self._take_complete()

    def overdue(self) -> Topic | None:
        """Return the first topic, in the order of data flow, whose message of the incomplete step is missing."""
        late = next((topic for topic in self._per_step if not self._held[topic.name]), None)
        if late is None and self._arrived.get(self.complete, 0) < self._wanted:
            return self._overdue_second()
        return late

    def drain(self) -> list[Arrival]:
        """Return what is left, step by step in canonical order, complete or not."""
        rest = self._take_latched()
        step = self.complete
        while any(self._held.values()) or self._events:
            rest.extend(self._take_step(step))
            step += 1
        return rest

    def _overdue_second(self) -> Topic | None:
        there = {one.topic.name for one in self._events.get(self.complete, ())}
        return next(
            (
                codec.topic
                for name, codec in self._seconds.items()
                if expects(self._spans.get(name, {}), self.complete) and codec.topic.name not in there
            ),
            None,
        )

    def _take_complete(self) -> list[Arrival]:
        taken: list[Arrival] = []
        while self._arrived.get(self.complete, 0) == self._wanted:
            taken.extend(self._take_latched())
            taken.extend(self._take_step(self.complete))
            self.complete += 1
            self._wanted = self._expected(self.complete)
        return taken

    def _take_step(self, step: int) -> list[Arrival]:
        taken = [Arrival(topic, self._held[topic.name].popleft()) for topic in self._per_step if self._held[topic.name]]
        taken.extend(self._in_order(self._events.pop(step, [])))
        self._arrived.pop(step, None)
        return taken

    def _take_latched(self) -> list[Arrival]:
        latched, self._latched = self._latched, []
        return self._in_order(latched)

    def _in_order(self, arrivals: list[Arrival]) -> list[Arrival]:
        """Sort by topic and, on /diagnostics, by monitor; each publisher's own order is kept."""
        return sorted(arrivals, key=lambda arrival: (self._order[arrival.topic.name], _number(arrival.frame_id)))

    def _expected(self, step: int) -> int:
        wanted = len(self._per_step) + sum(expects(spans, step) for spans in self._spans.values())
        if self._diagnostics is None or not self._diagnostics.due(step):
            return wanted
        return wanted + len(self._diagnostics.topic.publishers)


def _number(frame_id: str) -> int:
    """Trailing number of a frame id such as `dgu_12`, 0 when it has none."""
    digits = frame_id.rpartition("_")[2]
    return int(digits) if digits.isdigit() else 0
