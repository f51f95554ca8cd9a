"""A recorded run as arrays: the messages of fixed length are decoded a chunk at a time, not one by one.

`open_run` reads nothing but the documents; `windows` goes through the steps with only some of them in memory;
`read_run` holds them all.
"""

import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bags.mcap.container import Container, open_container, readable
from bags.mcap.definitions import differing
from bags.mcap.errors import BagError
from bags.mcap.topic import NANOSECONDS_PER_SECOND, TopicKind
from bags.runs.columns import columns_of, messages_of
from bags.runs.run_record import RunRecord
from bags.runs.widths import widths_of
from bags.watch.team_record import TeamRecord
from bags.wire import table
from bags.wire.origin import SCENARIO_ATTACHMENT
from bags.wire.records import DesignRecord, HistoryRecord, SecondRecord
from bags.wire.row import Row
from bags.wire.schema import Parts, RunTopics, run_topics
from bags.wire.second import spoofed_steps, take_newest, takes_newest
from dgu_sim.grid import Link
from dgu_sim.relay import RelayEvent
from dgu_sim.script import CommandEvent

WINDOW_STEPS = 2000
_EVERY_RUN = {row.key for row in (table.CLOCK, table.TICK, table.STATE, table.OUTPUT, table.RECEIVED, table.RESIDUAL)}
_STATE_TOPIC = re.compile(r"/dgu_(\d+)/state")
_LINK_TOPIC = re.compile(r"/dgu_(\d+)/(?:received|residual|design)/dgu_(\d+)")


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
        commands: What was commanded, by step; clock, DGUs and monitors before attacks.
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
    commands: tuple[CommandEvent, ...]
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
        seconds_of = _Seconds.of(self._container, self.topics)
        start = 0
        for fields in columns.windows(sizes, self._container.chunks(columns.by_name.keys())):
            size = min(steps, self.steps - start)
            seconds = seconds_of.within(start, start + size)
            if seconds and takes_newest(self.attachments.get(SCENARIO_ATTACHMENT, b"").decode()):
                spoofed = spoofed_steps(self.events, self.steps)
                take_newest(
                    fields["received.y"],
                    fields["received.delivered"],
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
                arrays=fields,
                histories=self.histories,
                designs=self.designs,
                input_designs=self.input_designs,
                events=self.events,
                commands=self.commands,
                alarms=self._within(table.ALARMS, start, start + size),
                attachments=self.attachments,
                team=self.team and replace(self.team, alarms=self._within(table.ACCUSATIONS, start, start + size)),
                streams=self._within(table.STREAM, start, start + size),
                seconds=seconds,
            )
            start += size
        counts = self._container.counts
        for name, column in columns.by_name.items():
            if column.read != counts[name]:
                raise BagError(f"{self.path}: {name} has {column.read} messages, its statistics promise {counts[name]}")

    def _within(self, row: Row[Any], start: int, end: int) -> tuple[Any, ...]:
        """The records of a row's steps [start, end): a late one stands behind later steps, but its stamp tells."""
        found: list[Any] = []
        decoders = _decoders(self.topics, row, found)
        _decode(self._container, decoders, (self.topics.stamp_ns(start), self.topics.stamp_ns(end) - 1))
        return tuple(sorted((one for one in found if start <= one.step < end), key=lambda one: one.step))


def open_run(path: Path | str) -> Run:
    """Open a bag that a run (in processes, composed or offline) left.

    Args:
        path: The bag's directory.

    Raises:
        BagError: Not a bag, not a bag of a run, not closed, or damaged: one line.
    """
    path = Path(path)
    container = open_container(path)
    topics = _topics_of(container)
    counts = container.counts
    steps = min(counts[topic.name] for topic in topics.per_step if topic.name in counts)
    said = _documents(container, topics)
    team = None
    if topics.team is not None:
        experiments = tuple(sorted(said[table.GRID_HISTORY.key], key=lambda one: one.experiment))
        designs = {one.monitor: one for one in said[table.TEAM_DESIGN.key]}
        team = TeamRecord(designs=designs, alarms=(), histories=experiments)
    own_designs = said.get(table.OWN_DESIGN.key, [])
    return Run(
        path=path,
        topics=topics,
        steps=steps,
        histories=tuple(sorted(said[table.HISTORY.key], key=lambda one: (one.dgu, one.experiment))),
        designs=_by_link([*said[table.DESIGN.key], *own_designs]),
        input_designs=_by_link(said.get(table.INPUT_DESIGN.key, [])),
        events=tuple(sorted((one for one in said[table.ATTACKS.key] if one.step < steps), key=lambda one: one.step)),
        commands=_commands(container, topics, steps),
        attachments=container.attachments,
        team=team,
        _container=container,
    )


def read_run(path: Path | str) -> RunRecord:
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
    ends = [(int(match[2]), int(match[1])) for name in types if (match := _LINK_TOPIC.fullmatch(name))]
    links = [Link(source, target) for source, target in sorted(set(ends)) if source != target]
    if not (dgus or links) or "/tick" not in types:
        found = " ".join(sorted(types)) or "none"
        raise BagError(
            f"{container.path}: found the topics {found:.80}, expected those of a run: /tick /dgu_1/state ..."
        )
    simulated = bool(dgus)  # if not: a stream from outside, nobody knows what the DGUs sent
    dgus = sorted({*dgus, *(end for link in links for end in (link.source, link.target))})
    team = any(type_name == "dcmg_msgs/msg/TeamEstimate" for type_name in types.values())
    parts = None
    if any(type_name == "dcmg_msgs/msg/Verdict" for type_name in types.values()):
        own, inputs = (kind in types.values() for kind in ("dcmg_msgs/msg/Own", "dcmg_msgs/msg/InputEstimate"))
        parts = Parts(local=own, inputs=inputs)
    definitions = differing(container.definitions.values())
    topics = _recorded(run_topics(dgus, links, 1, team=team, parts=parts, definitions=definitions), types)
    monitored = any(topics.residual(link).topic.name in types for link in links)
    residuals = [topics.residual(link).topic for link in topics.links] if monitored else []
    for topic in topics.per_step if simulated else [*topics.heard, *residuals]:
        if types.get(topic.name) != topic.type_name:
            raise BagError(
                f"{container.path}: {topic.name} is {types.get(topic.name, 'missing')}, expected {topic.type_name}"
            )
    return replace(
        topics, sampling_period_ns=_sampling_period_ns(container, topics), widths=widths_of(container, topics)
    )


def _recorded(topics: RunTopics, names: Collection[str]) -> RunTopics:
    """The topics without the rows that a run need not have and of which a bag has none: it may be older than they."""
    rows = [
        row
        for row in topics.rows
        if row.kind is not TopicKind.PER_STEP
        or row.key in _EVERY_RUN
        or any(topics.topic(row, place).name in names for place in topics.places(row.over))
    ]
    return replace(topics, rows=tuple(rows))


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


def _documents(container: Container, topics: RunTopics) -> dict[str, list[Any]]:
    """What the messages say that stand before step 0, and the few about attacks, by row of the table."""
    found: dict[str, list[Any]] = {}
    decoders: dict[str, Callable[[bytes], None]] = {}
    for row in topics.present:
        if row.kind is TopicKind.LATCHED or row.key == table.ATTACKS.key:
            decoders |= _decoders(topics, row, found.setdefault(row.key, []))
    _decode(container, decoders)
    return found


def _commands(container: Container, topics: RunTopics, steps: int) -> tuple[CommandEvent, ...]:
    """What was commanded at complete steps, in order."""
    found: list[CommandEvent] = []
    for codec in (topics.commands(), topics.attack_commands()):
        said: list[CommandEvent] = []
        if codec.topic.name in container.topics:
            _decode(container, {codec.topic.name: partial(_into, said, codec.decode)})
        found += sorted(said, key=lambda one: one.number)
    return tuple(sorted((one for one in found if one.step < steps), key=lambda one: one.step))


def _decoders(topics: RunTopics, row: Row[Any], records: list[Any]) -> dict[str, Callable[[bytes], None]]:
    """What puts the records of a row's topics into a list, by topic name."""
    codecs = [topics.codec(row, place) for place in topics.places(row.over)]
    return {codec.topic.name: partial(_into, records, codec.decode) for codec in codecs}


def _into(records: list[Any], decode: Callable[[bytes], Any], payload: bytes) -> None:
    records.append(decode(payload))


def _by_link(designs: Sequence[DesignRecord]) -> dict[Link, DesignRecord]:
    return {Link(one.source, one.monitor): one for one in designs}


@dataclass(frozen=True, slots=True)
class _Seconds:
    """The messages of second publishers on each link, by the steps that they claim; decoded once.

    Whatever their stamps say: anybody may have published them, so a window may need one from anywhere in the bag.
    """

    by_link: Mapping[Link, NDArray[np.void]]

    @classmethod
    def of(cls, container: Container, topics: RunTopics) -> "_Seconds":
        """Those in a bag that have the length of ours."""
        codecs = {topics.second(link).topic.name: (link, topics.second(link)) for link in topics.links}
        found: dict[str, list[bytes]] = {name: [] for name in codecs if name in container.topics}
        if found:
            _decode(container, {name: payloads.append for name, payloads in found.items()})
        by_link = {}
        for name, payloads in found.items():
            link, codec = codecs[name]
            messages = codec.layout.read(payloads)
            by_link[link] = messages[np.argsort(messages["step"], kind="stable")]
        return cls(by_link)

    def within(self, start: int, end: int) -> tuple[SecondRecord, ...]:
        """Those that claim steps [start, end), by step; of one step and link in the order of the bag."""
        found: list[SecondRecord] = []
        for link, messages in self.by_link.items():
            first, last = np.searchsorted(messages["step"], np.array([start, end], dtype=np.uint64))
            for one in messages[first:last]:
                y = tuple(map(float, one["y"]))
                found.append(SecondRecord(step=int(one["step"]), link=link, y=y, delivered=bool(one["delivered"])))
        return tuple(sorted(found, key=lambda one: one.step))
