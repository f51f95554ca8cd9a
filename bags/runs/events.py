"""The messages of varying occasion behind the per-step messages of a row, for a run without ROS."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from bags.mcap.topic import Topic
from bags.runs.alarm_events import in_order, link_alarms, local_alarms
from bags.watch.combined_arrays import CombinedFields
from bags.watch.monitors import MonitorArrays
from bags.wire.records import AlarmRecord
from bags.wire.schema import RunTopics
from bags.wire.stream import LinkFaults, stream_changes
from dgu_sim.commands import AttackCommand
from dgu_sim.records import Sample
from dgu_sim.simulate import Block
from monitor.stream_guard import Faults, StreamChange, StreamFault

Event: TypeAlias = tuple[int, Topic, bytes]
"""Row, topic and bytes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EventState:
    """What was told before a block.

    Attributes:
        alarm: Verdicts at the last step, shape (links,).
        own_alarm: Verdicts on the own states at the last step, shape (monitors,).
        faults: Faults of the streams at the last step.
    """

    alarm: NDArray[np.bool_]
    own_alarm: NDArray[np.bool_]
    faults: LinkFaults

    @classmethod
    def start(cls, topics: RunTopics) -> "EventState":
        """Before step 0."""
        return cls(
            alarm=np.zeros(len(topics.links), dtype=np.bool_),
            own_alarm=np.zeros(len(topics.monitors), dtype=np.bool_),
            faults=LinkFaults.none(topics.links),
        )


def events_of(
    topics: RunTopics,
    block: Block,
    outputs: MonitorArrays,
    before: EventState,
    combined: CombinedFields | None = None,
) -> tuple[EventState, dict[int, list[tuple[Topic, bytes]]]]:
    """Topic and bytes of the messages that follow the per-step messages of a row, in canonical order."""
    relayed = relayed_of(block)[1]
    doubled = [(one.step - block.first_step, one.position) for one in block.doubled]
    faults, changes = stream_changes(before.faults, topics.links, relayed, doubled, block.first_step)
    found: dict[int, list[tuple[Topic, bytes]]] = {}
    alarms = link_alarms(outputs, before.alarm, block.first_step, topics.links)
    own_alarm = before.own_alarm
    if topics.combined is not None and combined is not None and combined.local:
        alarms += local_alarms(combined, own_alarm, block.first_step, topics.combined)
        own_alarm = combined.local["alarm"][-1]
    for events in (
        _commands(topics, block),
        _second(topics, block),
        _alarms(topics, block, alarms),
        _streams(topics, block, changes),
        _attacks(topics, block),
        _diagnostics(topics, block, outputs, before.faults, changes),
    ):
        for row, topic, data in events:
            found.setdefault(row, []).append((topic, data))
    return EventState(alarm=outputs.alarm[-1], own_alarm=own_alarm, faults=faults), found


def relayed_of(block: Block) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """What the links themselves delivered in a block of one run: y (steps, links, 3), delivered (steps, links)."""
    y, delivered = block.received[:, 0], block.delivered[:, 0]
    if block.doubled:
        y, delivered = y.copy(), delivered.copy()
    for one in block.doubled:
        row = one.step - block.first_step
        y[row, one.position], delivered[row, one.position] = one.relayed[0], one.relayed_delivered[0]
    return y, delivered


def _second(topics: RunTopics, block: Block) -> Iterator[Event]:
    for one in block.doubled:
        codec = topics.second(topics.links[one.position])
        sample = Sample(y=one.spoofed[0].tolist(), delivered=bool(one.spoofed_delivered[0]))
        yield one.step - block.first_step, codec.topic, codec.encode(one.step, sample)


def _commands(topics: RunTopics, block: Block) -> Iterator[Event]:
    for one in sorted(block.commands, key=lambda one: isinstance(one.command, AttackCommand)):
        codec = topics.command_codec(one.command)
        yield one.step - block.first_step, codec.topic, codec.encode(one)


def _alarms(topics: RunTopics, block: Block, alarms: Sequence[AlarmRecord]) -> Iterator[Event]:
    for alarm in in_order(alarms):
        codec = topics.alarms(alarm.monitor)
        yield alarm.step - block.first_step, codec.topic, codec.encode_record(alarm)


def _streams(topics: RunTopics, block: Block, changes: list[tuple[int, int, StreamChange]]) -> Iterator[Event]:
    for row, position, change in changes:
        link = topics.links[position]
        codec = topics.stream(link.target)
        yield row, codec.topic, codec.encode(block.first_step + row, link.source, change)


def _attacks(topics: RunTopics, block: Block) -> Iterator[Event]:
    codec = topics.attack_events()
    for one in block.events:
        yield one.event.step - block.first_step, codec.topic, codec.encode(one.event)


def _diagnostics(
    topics: RunTopics,
    block: Block,
    outputs: MonitorArrays,
    faults: LinkFaults,
    changes: list[tuple[int, int, StreamChange]],
) -> Iterator[Event]:
    for monitor in topics.monitors:
        codec = topics.diagnostics(monitor)
        positions = [position for position, link in enumerate(topics.links) if link.target == monitor]
        for row in range(len(outputs.alarm)):
            step = block.first_step + row
            if codec.due(step):
                numbers = [outputs.at(row, position) for position in positions]
                streams = [_at(row, position, faults.active[position], changes) for position in positions]
                yield row, codec.topic, codec.encode(step, numbers, streams)


def _at(row: int, position: int, before: Faults, changes: list[tuple[int, int, StreamChange]]) -> Faults:
    """Faults of one link at one row."""
    active = set(before)
    for when, where, change in changes:
        if where == position and when <= row:
            (active.add if change.active else active.discard)(change.kind)
    return tuple(fault for fault in StreamFault if fault in active)
