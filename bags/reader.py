"""A recorded run as arrays: the messages of fixed length are decoded a chunk at a time, not one by one."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar, final

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from bags.cdr import Layout
from bags.chunk import MESSAGE_HEAD, MESSAGE_HEAD_LENGTH
from bags.codecs import NANOSECONDS_PER_SECOND
from bags.container import ChunkView, Container, open_container, readable, record_dtype
from bags.errors import BagError
from bags.records import AlarmRecord, DesignRecord, HistoryRecord
from bags.run_record import RunRecord
from bags.schema import RunTopics, run_topics
from dgu_sim.grid import Link
from dgu_sim.relay import RelayEvent

_STATE_TOPIC = re.compile(r"/dgu_(\d+)/state")
_RECEIVED_TOPIC = re.compile(r"/dgu_(\d+)/received/dgu_(\d+)")
_T = TypeVar("_T")
_VECTOR = 3  # components of states, outputs and residuals
_CHUNKS_AT_ONCE = 100


def read_run(path: Path) -> RunRecord:
    """Read a bag that a run (in processes, composed or offline) left.

    Args:
        path: The bag's directory.

    Returns:
        The run up to its last complete step.

    Raises:
        BagError: Not a bag, not a bag of a run, not closed, or damaged: one line.
    """
    container = open_container(path)
    topics = _topics_of(container)
    counts = container.counts
    steps = min(counts[topic.name] for topic in topics.per_step)
    arrays = _Arrays.of(topics, steps)
    others = _Others()
    columns, decoders = arrays.columns(topics), others.decoders(topics)
    for channels, chunk in container.chunks():
        with readable(path):
            for channel_id in chunk.offsets:
                name = channels[channel_id].topic
                if name in columns:
                    columns[name].take(chunk, channel_id, name)
                elif name in decoders:
                    for payload in chunk.payloads(channel_id):
                        decoders[name](payload)
    for name, column in columns.items():
        column.decode(name)
        if column.filled != counts[name]:
            raise BagError(f"{path}: {name} has {column.filled} messages, its statistics promise {counts[name]}")
    return RunRecord(
        path=path,
        topics=topics,
        steps=steps,
        **arrays.fields(),
        histories=tuple(sorted(others.histories, key=lambda one: (one.dgu, one.experiment))),
        designs={Link(one.source, one.monitor): one for one in others.designs},
        events=tuple(sorted((one for one in others.events if one.step < steps), key=lambda one: one.step)),
        alarms=tuple(sorted((one for one in others.alarms if one.step < steps), key=lambda one: one.step)),
        attachments=container.attachments,
    )


def _topics_of(container: Container) -> RunTopics:
    """DGUs, links and sampling period, as the topics and their first stamps tell them."""
    types = container.topics
    dgus = [int(match[1]) for name in types if (match := _STATE_TOPIC.fullmatch(name))]
    links = [Link(int(match[2]), int(match[1])) for name in types if (match := _RECEIVED_TOPIC.fullmatch(name))]
    if not dgus or "/tick" not in types:
        found = " ".join(sorted(types)) or "none"
        raise BagError(
            f"{container.path}: found the topics {found:.80}, expected those of a run: /tick /dgu_1/state ..."
        )
    topics = run_topics(dgus, links, 1)
    for topic in topics.per_step:
        if types.get(topic.name) != topic.type_name:
            raise BagError(
                f"{container.path}: {topic.name} is {types.get(topic.name, 'missing')}, expected {topic.type_name}"
            )
    return run_topics(dgus, links, _sampling_period_ns(container, topics))


def _sampling_period_ns(container: Container, topics: RunTopics) -> int:
    """T_s [ns] from the stamp of step 1, or from a history when the run ended before it."""
    layout = topics.tick().layout
    histories = {topics.history(dgu).topic.name: topics.history(dgu) for dgu in topics.dgus}
    recorded = 0
    for channels, chunk in container.chunks():
        with readable(container.path):
            for channel_id in chunk.offsets:
                name = channels[channel_id].topic
                if name in histories and len(chunk.offsets[channel_id]):
                    recorded = round(histories[name].decode(next(chunk.payloads(channel_id))).sampling_period_sec * 1e9)
                if name == "/tick":
                    ticks = _decoded([_records(chunk, channel_id, layout, name)], [channel_id], layout, name)
                    for tick in ticks[ticks["step"] == 1]:
                        sec, nanosec = int(tick["header.stamp.sec"]), int(tick["header.stamp.nanosec"])
                        return sec * NANOSECONDS_PER_SECOND + nanosec
    if not recorded:
        raise BagError(f"{container.path}: the run ended before step 1 and holds no history, so its T_s is unknown")
    return recorded


def _records(chunk: ChunkView, channel_id: int, layout: Layout, name: str) -> NDArray[np.void]:
    records = chunk.records(channel_id, MESSAGE_HEAD.size + layout.size)
    if records is None:
        raise _wrong_length(layout, name)
    return records


def _decoded(
    parts: Sequence[NDArray[np.void]], channel_ids: Sequence[int], layout: Layout, name: str
) -> NDArray[np.void]:
    """Messages of some chunks one after the other, once their heads say that they are what the index promised."""
    records = np.concatenate(parts).view(record_dtype(layout.dtype))
    if np.any(records["opcode"] != Opcode.MESSAGE) or np.any(records["length"] != MESSAGE_HEAD_LENGTH + layout.size):
        raise _wrong_length(layout, name)
    if np.any(records["channel_id"] != np.repeat(channel_ids, [len(part) for part in parts])):
        raise BagError(f"{name}: the message index points to messages of another topic")
    messages: NDArray[np.void] = records["message"]
    return messages


def _wrong_length(layout: Layout, name: str) -> BagError:
    return BagError(f"{name}: a message has another length than the {layout.size} bytes of {layout.type_name}")


@final
@dataclass(slots=True, kw_only=True)
class _Column:
    """Where the fields of one per-step topic go, and how many of its steps are there already."""

    layout: Layout
    targets: Mapping[str, NDArray[Any]]
    filled: int = 0
    waiting: list[NDArray[np.void]] = field(default_factory=list)
    channel_ids: list[int] = field(default_factory=list)

    def take(self, chunk: ChunkView, channel_id: int, name: str) -> None:
        """Take the messages of one chunk; decode once there are enough for numpy to be quick."""
        self.waiting.append(_records(chunk, channel_id, self.layout, name))
        self.channel_ids.append(channel_id)
        if len(self.waiting) >= _CHUNKS_AT_ONCE:
            self.decode(name)

    def decode(self, name: str) -> None:
        """Copy what waits to where it belongs."""
        if not self.waiting:
            return
        messages = _decoded(self.waiting, self.channel_ids, self.layout, name)
        self.waiting.clear()
        self.channel_ids.clear()
        start = self.filled
        self.filled += len(messages)
        if "step" in self.layout.names:
            wrong = np.flatnonzero(messages["step"] != np.arange(start, self.filled))
            if len(wrong):
                found = int(messages["step"][wrong[0]])
                raise BagError(f"{name}: found step {found}, expected step {start + int(wrong[0])}")
        for field_name, target in self.targets.items():
            target[start : self.filled] = messages[field_name][: max(len(target) - start, 0)]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Arrays:
    """The arrays of a RunRecord, still to be filled."""

    dgu_fields: Mapping[str, NDArray[Any]]
    output_fields: Mapping[str, NDArray[Any]]
    received_fields: Mapping[str, NDArray[Any]]
    residual_fields: Mapping[str, NDArray[Any]]

    @classmethod
    def of(cls, topics: RunTopics, steps: int) -> "_Arrays":
        """Empty arrays for a number of steps."""
        dgus, links = (steps, len(topics.dgus)), (steps, len(topics.links))
        return cls(
            dgu_fields={
                "x": np.empty((*dgus, _VECTOR)),
                **{name: np.empty(dgus) for name in ("load_current", "reference", "alpha")},
            },
            output_fields={"y": np.empty((*dgus, _VECTOR))},
            received_fields={"y": np.empty((*links, _VECTOR)), "delivered": np.empty(links, dtype=np.bool_)},
            residual_fields={
                "phase": np.empty(links, dtype=np.uint8),
                "alarm": np.empty(links, dtype=np.bool_),
                **{name: np.empty((*links, _VECTOR)) for name in ("estimate", "residual", "threshold")},
            },
        )

    def columns(self, topics: RunTopics) -> dict[str, _Column]:
        """The destination of every per-step topic by name."""
        clock, tick = topics.clock(), topics.tick()
        found = {codec.topic.name: _Column(layout=codec.layout, targets={}) for codec in (clock, tick)}
        for position, dgu in enumerate(topics.dgus):
            state, output = topics.state(dgu), topics.output(dgu)
            found[state.topic.name] = _column(state.layout, self.dgu_fields, position)
            found[output.topic.name] = _column(output.layout, self.output_fields, position)
        for position, link in enumerate(topics.links):
            received, residual = topics.received(link), topics.residual(link)
            found[received.topic.name] = _column(received.layout, self.received_fields, position)
            found[residual.topic.name] = _column(residual.layout, self.residual_fields, position)
        return found

    def fields(self) -> dict[str, Any]:
        """The arrays by the names they have in a RunRecord."""
        received = {"received": self.received_fields["y"], "delivered": self.received_fields["delivered"]}
        return {**self.dgu_fields, **self.output_fields, **received, **self.residual_fields}


def _column(layout: Layout, fields: Mapping[str, NDArray[Any]], position: int) -> _Column:
    return _Column(layout=layout, targets={name: array[:, position] for name, array in fields.items()})


@final
@dataclass(frozen=True, slots=True)
class _Others:
    """What the messages besides the per-step ones say."""

    histories: list[HistoryRecord] = field(default_factory=list)
    designs: list[DesignRecord] = field(default_factory=list)
    events: list[RelayEvent] = field(default_factory=list)
    alarms: list[AlarmRecord] = field(default_factory=list)

    def decoders(self, topics: RunTopics) -> dict[str, Callable[[bytes], None]]:
        """What to do with a message, by topic name."""
        found: dict[str, Callable[[bytes], None]] = {}
        for dgu in topics.dgus:
            history = topics.history(dgu)
            found[history.topic.name] = _into(self.histories, history.decode)
        for link in topics.links:
            design = topics.design(link)
            found[design.topic.name] = _into(self.designs, design.decode)
        for monitor in topics.monitors:
            alarms = topics.alarms(monitor)
            found[alarms.topic.name] = _into(self.alarms, alarms.decode)
        events = topics.attack_events()
        found[events.topic.name] = _into(self.events, events.decode)
        return found


def _into(records: list[_T], decode: Callable[[bytes], _T]) -> Callable[[bytes], None]:
    return lambda payload: records.append(decode(payload))
