"""The messages of the monitors of a run from its arrays: what the reader does, the other way round."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bags.mcap.blocks import block_format
from bags.mcap.errors import BagError
from bags.mcap.topic import Topic
from bags.runs.offline import combined_numbers
from bags.runs.run_record import RunRecord
from bags.watch.combined_arrays import CombinedArrays, CombinedFields
from bags.wire.combined_topics import MASKS, CombinedTopics
from monitor.link_monitor import MonitorOutput
from monitor.stream_guard import Faults

_VERDICT = ("phase", "alarm", "estimate", "residual", "threshold")


def concluded_rows(window: RunRecord) -> dict[str, NDArray[np.void]]:
    """The messages with which monitors speak at every step of a window, by topic, shape (steps,)."""
    found: dict[str, tuple[Topic, Mapping[str, Any]]] = {}
    for position, link in enumerate(window.links):
        arrays = {name: getattr(window, name)[:, position] for name in _VERDICT}
        topic = window.topics.residual(link).topic
        found[topic.name] = topic, {**arrays, "source": link.source, "monitor": link.target}
    topics = {topic.name: topic for topic in window.topics.per_step}
    if window.topics.combined is not None and window.combined is not None:
        numbers = combined_numbers(window.topics.combined)
        for name, arrays in _fields(window.combined, window.topics.combined).by_topic(window.topics.combined):
            found[name] = topics[name], {**arrays, **numbers[name]}
    if window.topics.team is not None and window.told is not None:
        told = window.told.targets(window.topics.team)
        for member in window.topics.dgus:
            topic = window.topics.team.estimate(member).topic
            found[topic.name] = topic, {**told[topic.name], "monitor": member}
    layout = block_format([topic for topic, _ in found.values()], dict.fromkeys(found, 0))
    rows = layout.block(window.first_step, window.steps, window.topics.sampling_period_ns)
    for name, (_, values) in found.items():
        for key, value in values.items():
            rows[name][key] = value
    return {name: rows[name] for name in found}


def concluded_events(window: RunRecord) -> Iterator[tuple[int, Topic, bytes]]:
    """Step, topic and bytes of every alarm that starts or ends in a window."""
    for alarm in window.alarms:
        codec = window.topics.alarms(alarm.monitor)
        yield alarm.step, codec.topic, codec.encode_record(alarm)
    if window.topics.team is not None and window.team is not None:
        for accusation in window.team.alarms:
            codec = window.topics.team.alarms(accusation.monitor)
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
    codecs = [(topics.design(link), window.designs.get(link)) for link in window.links]
    if topics.combined is not None:
        own = {(one.source, one.monitor): one for one in window.designs.values()}
        monitors = topics.combined.monitors if topics.combined.parts.local else ()
        codecs += [(topics.combined.design(monitor), own.get((monitor, monitor))) for monitor in monitors]
        links = window.links if topics.combined.parts.inputs else ()
        codecs += [(topics.combined.input_design(link), window.input_designs.get(link)) for link in links]
    if topics.team is not None and window.team is not None:
        codecs += [(topics.team.design(member), window.team.designs.get(member)) for member in topics.dgus]
    for codec, design in codecs:
        if design is None:
            raise BagError(f"{window.path}: nothing was designed for {codec.topic.name}")
        found[codec.topic.name] = codec.encode(design)
    return found


def _output(window: RunRecord, row: int, position: int) -> MonitorOutput:
    vectors = (getattr(window, name)[row, position].tolist() for name in _VERDICT[2:])
    return MonitorOutput(int(window.phase[row, position]), bool(window.alarm[row, position]), *vectors)


def _fields(arrays: CombinedArrays, topics: CombinedTopics) -> CombinedFields:
    """The fields of the messages: flags become masks again."""
    verdict: dict[str, NDArray[Any]] = {
        name: _masks(getattr(arrays.verdict, name), topics) for name in (*MASKS, "dropped")
    }
    return CombinedFields(
        verdict={**verdict, "local": arrays.verdict.local},
        local=_named(arrays.local, _VERDICT),
        inputs=_named(arrays.inputs, ("lag", "phase", "alarm", "input", "lower", "upper", "rate")),
    )


def _named(arrays: object, names: Sequence[str]) -> dict[str, NDArray[Any]]:
    return {} if arrays is None else {name: getattr(arrays, name) for name in names}


def _masks(flags: NDArray[np.bool_], topics: CombinedTopics) -> NDArray[np.uint64]:
    """Flags (steps, links) as masks (steps, monitors), bit i for the i-th incoming link."""
    masks = np.zeros((len(flags), len(topics.monitors)), dtype=np.uint64)
    at = 0
    for position, monitor in enumerate(topics.monitors):
        for bit in range(len(topics.sources(monitor))):
            masks[:, position] |= flags[:, at].astype(np.uint64) << np.uint64(bit)
            at += 1
    return masks
