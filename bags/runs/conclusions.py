"""The messages of the monitors of a run from its arrays: what the reader does, the other way round."""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from bags.mcap.blocks import block_format
from bags.mcap.errors import BagError
from bags.mcap.topic import Topic
from bags.runs.run_record import RunRecord
from bags.wire import table
from bags.wire.arrays import columns
from bags.wire.records import DesignRecord
from dgu_sim.grid import Link
from monitor.link_monitor import MonitorOutput
from monitor.stream_guard import Faults


def concluded_rows(window: RunRecord) -> dict[str, NDArray[np.void]]:
    """The messages with which monitors speak at every step of a window, by topic, shape (steps,)."""
    told = [one for one in columns(window.topics, window.arrays) if one.row.publisher.startswith("monitor_")]
    layout = block_format([one.topic for one in told], dict.fromkeys((one.topic.name for one in told), 0))
    rows = layout.block(window.first_step, window.steps, window.topics.sampling_period_ns)
    for column in told:
        column.write(rows[column.topic.name])
    return {one.topic.name: rows[one.topic.name] for one in told}


def concluded_events(window: RunRecord) -> Iterator[tuple[int, Topic, bytes]]:
    """Step, topic and bytes of every alarm that starts or ends in a window."""
    for alarm in window.alarms:
        codec = window.topics.alarms(alarm.monitor)
        yield alarm.step, codec.topic, codec.encode_record(alarm)
    if window.topics.team is not None and window.team is not None:
        for accusation in window.team.alarms:
            codec = window.topics.accusations(accusation.monitor)
            yield accusation.step, codec.topic, codec.encode_record(accusation)


def diagnosed(window: RunRecord, step: int, faults: Mapping[tuple[int, int], Faults]) -> Iterator[tuple[Topic, bytes]]:
    """Topic and bytes of what the monitors say about their health at a step of a window.

    Args:
        window: The window.
        step: The step.
        faults: What is wrong with the stream on each link (source, target) at that step.
    """
    row = step - window.first_step
    for monitor in window.topics.monitors:
        codec = window.topics.diagnostics(monitor)
        if codec.due(step):
            links = [(at, link) for at, link in enumerate(window.links) if link.target == monitor]
            outputs = [_output(window, row, at) for at, _ in links]
            yield (
                codec.topic,
                codec.encode(step, outputs, [faults.get((link.source, link.target), ()) for _, link in links]),
            )


def designed(window: RunRecord) -> dict[str, bytes]:
    """Bytes of what was designed, by topic.

    Raises:
        BagError: A design is missing.
    """
    topics, found = window.topics, {}
    for row in topics.present:
        for place in topics.places(row.over) if row.type_name == table.DESIGN.type_name else ():
            codec = topics.codec(row, place)
            design = _design(window, row.key, place)
            if design is None:
                raise BagError(f"{window.path}: nothing was designed for {codec.topic.name}")
            found[codec.topic.name] = codec.encode(design)
    return found


def _design(window: RunRecord, key: str, place: Link) -> DesignRecord | None:
    if key == table.TEAM_DESIGN.key:
        return None if window.team is None else window.team.designs.get(place.target)
    return (window.input_designs if key == table.INPUT_DESIGN.key else window.designs).get(place)


def _output(window: RunRecord, row: int, position: int) -> MonitorOutput:
    vectors = (getattr(window, name)[row, position].tolist() for name in MonitorOutput._fields[2:])
    return MonitorOutput(int(window.phase[row, position]), bool(window.alarm[row, position]), *vectors)
