"""A recorded run as arrays: the messages of fixed length are decoded a chunk at a time, not one by one.

`open_run` reads nothing but the documents; `windows` goes through the steps with only some of them in memory;
`read_run` holds them all.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TypeVar, final

from bags.mcap.container import Container, open_container, readable
from bags.mcap.errors import BagError
from bags.runs.columns import columns_of, messages_of
from bags.runs.origin import SCENARIO_ATTACHMENT
from bags.runs.run_record import RunRecord
from bags.watch.team_record import TeamRecord
from bags.wire.codecs import NANOSECONDS_PER_SECOND, AlarmCodec
from bags.wire.combined_topics import CombinedTopics, parts_among
from bags.wire.records import AlarmRecord, DesignRecord, HistoryRecord, SecondRecord, StreamRecord
from bags.wire.schema import RunTopics, run_topics
from bags.wire.second import second_record, spoofed_steps, take_newest, takes_newest
from dgu_sim.grid import Link
from dgu_sim.relay import RelayEvent

WINDOW_STEPS = 2000
_STATE_TOPIC = re.compile(r"/dgu_(\d+)/state")
_RECEIVED_TOPIC = re.compile(r"/dgu_(\d+)/received/dgu_(\d+)")
_T = TypeVar("_T")
_Stepped = TypeVar("_Stepped", AlarmRecord, StreamRecord)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """A recorded run opened for reading; holds no step in memory.

    Attributes:
        path: The bag.
        topics: DGUs, links and sampling period.
        steps: Complete steps: a last step of which messages are missing is left out.
        histories: Offline experiments, by DGU and number.
        designs: What was designed for each link; for the own state of DGU j, as link j-j.
        input_designs: What estimates the input of the source of each link.
        events: Attacks that started or stopped, in order of time.
        attachments: Documents in the bag by name.
        team: Designs and accusations of the team, None without.
    """

    path: Path
    topics: RunTopics
    steps: int
    histories: tuple[HistoryRecord, ...]
    designs: Mapping[Link, DesignRecord]
    input_designs: Mapping[Link, DesignRecord]
    events: tuple[RelayEvent, ...]
    attachments: Mapping[str, bytes]
    team: TeamRecord | None
    _container: Container

    @property
    def links(self) -> tuple[Link, ...]:
        """The links, ordered by (target, source)."""
        return self.topics.links

    def windows(self, steps: int = WINDOW_STEPS) -> Iterator[RunRecord]:
        """The run from its first step to its last, a window at a time; one empty window if it has no step.

        Args:
            steps: Steps of a window, but for the last one.

        Raises:
            BagError: The bag is damaged, or a step is missing: one line.
        """
        sizes = [min(steps, self.steps - start) for start in range(0, max(self.steps, 1), steps)]
        columns = columns_of(self.topics, self._container.topics)
        start = 0
        for fields in columns.windows(sizes, self._container.chunks(columns.by_name.keys())):
            size = min(steps, self.steps - start)
            seconds = self._seconds(start, start + size)
            if seconds and takes_newest(self.attachments.get(SCENARIO_ATTACHMENT, b"").decode()):
                spoofed = spoofed_steps(self.events, self.steps)
                take_newest(
                    fields["received"],
                    fields["delivered"],
                    seconds,
                    self.topics.links,
                    first_step=start,
                    attacks=spoofed,
                )
            yield RunRecord(
                path=self.path,
                topics=self.topics,
                steps=size,
                first_step=start,
                **fields,
                histories=self.histories,
                designs=self.designs,
                input_designs=self.input_designs,
                events=self.events,
                alarms=self._alarms(start, start + size),
                attachments=self.attachments,
                team=self._team(start, start + size),
                streams=self._streams(start, start + size),
                seconds=seconds,
            )
            start += size
        counts = self._container.counts
        for name, column in columns.by_name.items():
            if column.read != counts[name]:
                raise BagError(f"{self.path}: {name} has {column.read} messages, its statistics promise {counts[name]}")

    def _alarms(self, start: int, end: int) -> tuple[AlarmRecord, ...]:
        return self._alarms_on([self.topics.alarms(monitor) for monitor in self.topics.monitors], start, end)

    def _team(self, start: int, end: int) -> TeamRecord | None:
        """What the run says about its team, with the accusations of steps [start, end)."""
        if self.team is None or self.topics.team is None:
            return None
        codecs = [self.topics.team.alarms(member) for member in self.topics.dgus]
        return replace(self.team, alarms=self._alarms_on(codecs, start, end))

    def _alarms_on(self, codecs: Sequence[AlarmCodec], start: int, end: int) -> tuple[AlarmRecord, ...]:
        """The alarms of steps [start, end): a late one stands behind later steps, but its stamp tells."""
        found: list[AlarmRecord] = []
        decoders = {codec.topic.name: _into(found, codec.decode) for codec in codecs}
        return self._within(found, decoders, start, end)

    def _streams(self, start: int, end: int) -> tuple[StreamRecord, ...]:
        """The faults of streams told of steps [start, end)."""
        found: list[StreamRecord] = []
        codecs = [self.topics.stream(monitor) for monitor in self.topics.monitors]
        decoders = {codec.topic.name: _into(found, codec.decode) for codec in codecs}
        return self._within(found, decoders, start, end)

    def _seconds(self, start: int, end: int) -> tuple[SecondRecord, ...]:
        """The messages of second publishers that claim steps [start, end)."""
        found: list[SecondRecord | None] = []
        decoders = {
            self.topics.second(link).topic.name: _into(found, partial(second_record, self.topics, link))
            for link in self.topics.links
        }
        if decoders.keys().isdisjoint(self._container.topics):
            return ()
        _decode(self._container, decoders)  # whatever their stamps say: anybody may have published them
        ours = [one for one in found if one is not None and start <= one.step < end]
        return tuple(sorted(ours, key=lambda one: one.step))

    def _within(
        self, found: list[_Stepped], decoders: Mapping[str, Callable[[bytes], None]], start: int, end: int
    ) -> tuple[_Stepped, ...]:
        _decode(self._container, decoders, (self.topics.stamp_ns(start), self.topics.stamp_ns(end) - 1))
        return tuple(sorted((one for one in found if start <= one.step < end), key=lambda one: one.step))


def open_run(path: Path) -> Run:
    """Open a bag that a run (in processes, composed or offline) left.

    Args:
        path: The bag's directory.

    Raises:
        BagError: Not a bag, not a bag of a run, not closed, or damaged: one line.
    """
    container = open_container(path)
    topics = _topics_of(container)
    counts = container.counts
    steps = min(counts[topic.name] for topic in topics.per_step if topic.name in counts)
    documents = _Documents()
    _decode(container, documents.decoders(topics))
    return Run(
        path=path,
        topics=topics,
        steps=steps,
        histories=tuple(sorted(documents.histories, key=lambda one: (one.dgu, one.experiment))),
        designs={Link(one.source, one.monitor): one for one in documents.designs},
        input_designs={Link(one.source, one.monitor): one for one in documents.input_designs},
        events=tuple(sorted((one for one in documents.events if one.step < steps), key=lambda one: one.step)),
        attachments=container.attachments,
        team=documents.team(topics),
        _container=container,
    )


def read_run(path: Path) -> RunRecord:
    """Read a whole run into memory: about 2 kB for each step of six DGUs.

    Args:
        path: The bag's directory.

    Returns:
        The run up to its last complete step.

    Raises:
        BagError: Not a bag, not a bag of a run, not closed, or damaged: one line.
    """
    run = open_run(path)
    (record,) = run.windows(max(run.steps, 1))
    return record


def _decode(
    container: Container, decoders: Mapping[str, Callable[[bytes], None]], times_ns: tuple[int, int] | None = None
) -> None:
    """Decode every message of some topics one by one."""
    for channels, chunk in container.chunks(decoders.keys(), times_ns):
        with readable(container.path):
            for channel_id in chunk.offsets:
                for payload in chunk.payloads(channel_id):
                    decoders[channels[channel_id].topic](payload)


def _topics_of(container: Container) -> RunTopics:
    """DGUs, links and sampling period, as the topics and their first stamps tell them."""
    types = container.topics
    dgus = [int(match[1]) for name in types if (match := _STATE_TOPIC.fullmatch(name))]
    links = [Link(int(match[2]), int(match[1])) for name in types if (match := _RECEIVED_TOPIC.fullmatch(name))]
    if not (dgus or links) or "/tick" not in types:
        found = " ".join(sorted(types)) or "none"
        raise BagError(
            f"{container.path}: found the topics {found:.80}, expected those of a run: /tick /dgu_1/state ..."
        )
    simulated = bool(dgus)
    if not simulated:  # a stream from outside: nobody knows what the DGUs sent
        dgus = sorted({end for link in links for end in (link.source, link.target)})
    team = any(type_name == "dcmg_msgs/msg/TeamEstimate" for type_name in types.values())
    parts = parts_among(types)
    topics = run_topics(dgus, links, 1, team=team, parts=parts)
    monitored = any(topics.residual(link).topic.name in types for link in links)
    residuals = [topics.residual(link).topic for link in topics.links] if monitored else []
    for topic in topics.per_step if simulated else [*topics.heard, *residuals]:
        if types.get(topic.name) != topic.type_name:
            raise BagError(
                f"{container.path}: {topic.name} is {types.get(topic.name, 'missing')}, expected {topic.type_name}"
            )
    return run_topics(dgus, links, _sampling_period_ns(container, topics), team=team, parts=parts)


def _sampling_period_ns(container: Container, topics: RunTopics) -> int:
    """T_s [ns] from the stamp of step 1, or from a history when the run ended before it."""
    tick, layout = topics.tick().topic.name, topics.tick().layout
    histories = {topics.history(dgu).topic.name: topics.history(dgu) for dgu in topics.dgus}
    recorded = 0
    for channels, chunk in container.chunks({tick, *histories}):
        with readable(container.path):
            for channel_id in chunk.offsets:
                name = channels[channel_id].topic
                if name in histories and len(chunk.offsets[channel_id]):
                    recorded = round(histories[name].decode(next(chunk.payloads(channel_id))).sampling_period_sec * 1e9)
                if name == tick:
                    ticks = messages_of(chunk, channel_id, layout, name)
                    for one in ticks[ticks["step"] == 1]:
                        sec, nanosec = int(one["header.stamp.sec"]), int(one["header.stamp.nanosec"])
                        return sec * NANOSECONDS_PER_SECOND + nanosec
    if not recorded:
        raise BagError(f"{container.path}: the run ended before step 1 and holds no history, so its T_s is unknown")
    return recorded


@final
@dataclass(frozen=True, slots=True)
class _Documents:
    """What the messages say that stand before step 0, and the few about attacks."""

    histories: list[HistoryRecord] = field(default_factory=list)
    designs: list[DesignRecord] = field(default_factory=list)
    input_designs: list[DesignRecord] = field(default_factory=list)
    events: list[RelayEvent] = field(default_factory=list)
    team_designs: list[DesignRecord] = field(default_factory=list)
    team_histories: list[HistoryRecord] = field(default_factory=list)

    def team(self, topics: RunTopics) -> TeamRecord | None:
        """What was said about the team, if there is one."""
        if topics.team is None:
            return None
        designs = {one.monitor: one for one in self.team_designs}
        histories = tuple(sorted(self.team_histories, key=lambda one: one.experiment))
        return TeamRecord(designs=designs, alarms=(), histories=histories)

    def decoders(self, topics: RunTopics) -> dict[str, Callable[[bytes], None]]:
        """What to do with a message, by topic name."""
        found: dict[str, Callable[[bytes], None]] = {}
        for dgu in topics.dgus:
            history = topics.history(dgu)
            found[history.topic.name] = _into(self.histories, history.decode)
        for link in topics.links:
            design = topics.design(link)
            found[design.topic.name] = _into(self.designs, design.decode)
        if topics.combined is not None:
            found |= self._combined(topics.combined)
        events = topics.attack_events()
        found[events.topic.name] = _into(self.events, events.decode)
        if topics.team is not None:
            history = topics.team.history()
            found[history.topic.name] = _into(self.team_histories, history.decode)
            for member in topics.dgus:
                design = topics.team.design(member)
                found[design.topic.name] = _into(self.team_designs, design.decode)
        return found

    def _combined(self, topics: CombinedTopics) -> dict[str, Callable[[bytes], None]]:
        """The same for what only monitors have that draw one conclusion from several tests."""
        own = [topics.design(monitor) for monitor in topics.monitors if topics.parts.local]
        inputs = [topics.input_design(link) for link in topics.links if topics.parts.inputs]
        found = {codec.topic.name: _into(self.designs, codec.decode) for codec in own}
        return found | {codec.topic.name: _into(self.input_designs, codec.decode) for codec in inputs}


def _into(records: list[_T], decode: Callable[[bytes], _T]) -> Callable[[bytes], None]:
    return lambda payload: records.append(decode(payload))
