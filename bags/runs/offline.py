"""A run without ROS: simulator, monitors and bag in one process, as fast as one core goes.

The steps, the codecs and the order of the messages are those of the nodes, so the bag is the one a run leaves.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bags.mcap.recording import CHUNK_PRESETS, ChunkPreset, Recording
from bags.mcap.writer import BagWriter
from bags.runs.events import EventState, events_of, relayed_of
from bags.runs.following import follow
from bags.runs.team_offline import TeamProgress, team_arrays, write_team_documents
from bags.watch.combined_arrays import CombinedFields
from bags.watch.designs import RunDesigns, design_scenario
from bags.watch.histories import grid_history_of_run, histories_of_run, recorded_states
from bags.watch.monitors import MonitorArrays
from bags.wire.arrays import grouped, write
from bags.wire.origin import attach_origin
from bags.wire.records import HistoryRecord
from bags.wire.schema import RunTopics
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import Block
from monitor.link_monitor import MonitorOutput

# few hundred steps a chunk: nobody waits for them to reach the disk, and larger chunks cost less
_RECORDING = Recording(chunks=ChunkPreset.COMPACT)
_BLOCK_STEPS = 500


def simulate_to_bag(
    scenario: Scenario,
    path: Path,
    progress: Callable[[int], None] | None = None,
    recording: Recording = _RECORDING,
    host: Mapping[str, object] | None = None,
    *,
    designs: RunDesigns | None = None,
) -> Path:
    """Run a scenario from step 0 to its end and record it.

    Args:
        scenario: What to run.
        path: The bag's directory; must not exist.
        progress: Called with the number of steps done.
        recording: How; chunks are closed by size only, and written at once, because nobody waits.
        host: What `origin.host_facts` gave, if the bag is to say where it was made.
        designs: What its monitors run; None: designed here.

    Returns:
        The path.

    Raises:
        BagError: The bag cannot be written.
        monitor.errors.MonitorError: Unknown observer or detector, or options of theirs.
    """
    designs = design_scenario(scenario) if designs is None else designs
    topics = designs.topics
    records = {dgu: histories_of_run(scenario, dgu) for dgu in topics.dgus}
    team = _team(scenario, designs)
    told = EventState.start(topics)
    with BagWriter(
        path,
        topics.all,
        compression=recording.compression,
        chunk_bytes=CHUNK_PRESETS[recording.chunks].max_bytes,
        max_chunk_age_sec=None,
        split=recording.split,
        topic_filter=recording.topics,
    ) as writer:
        attach_origin(writer, scenario, host)
        _write_latched(writer, designs, records)
        if team is not None:
            write_team_documents(writer, team)
        layout = writer.format_of(topics.per_step)
        for block, outputs, combined in follow(scenario, designs, recorded_states(scenario), _BLOCK_STEPS):
            rows = layout.block(block.first_step, len(block.x), topics.sampling_period_ns)
            arrays = arrays_of(block, outputs, combined)
            told, events = events_of(topics, block, outputs, told, combined)
            _announce(writer, topics, block)
            if team is not None:
                arrays |= team_arrays(team, block, events)
            write(rows, topics, arrays)
            cuts = [0, *sorted({row + 1 for row in events} - {len(rows)}), len(rows)]
            for start, end in pairwise(cuts):
                writer.write_block(layout, rows[start:end])
                stamp_ns = topics.stamp_ns(block.first_step + end - 1)
                for topic, data in events.get(end - 1, ()):
                    writer.write(topic.name, stamp_ns, data)
            if progress is not None:
                progress(block.first_step + len(rows))
    return path


def _announce(writer: BagWriter, topics: RunTopics, block: Block) -> None:
    """Announce the topics that a bag has only where they say something."""
    said = [topics.command_codec(one.command).topic for one in block.commands]
    for topic in [*said, *(topics.second(topics.links[one.position]).topic for one in block.doubled)]:
        if topic.name not in writer.counts:
            writer.add_topic(topic)


def _team(scenario: Scenario, designs: RunDesigns) -> TeamProgress | None:
    if designs.team is None:
        return None
    return TeamProgress(team=designs.team, histories=tuple(grid_history_of_run(scenario)))


def arrays_of(block: Block, outputs: MonitorArrays, combined: CombinedFields | None) -> dict[str, NDArray[Any]]:
    """What is told at every step of a block of one run, by the names of the table of messages."""
    state = {name: getattr(block, name)[:, 0] for name in ("x", "load_current", "reference", "alpha")}
    y, delivered = relayed_of(block)
    found = {
        **grouped("state", state),
        "output.y": block.y[:, 0],
        "output.delivered": np.ones(block.alpha[:, 0].shape, dtype=np.bool_),
        "received.y": y,
        "received.delivered": delivered,
        **judged(outputs),
    }
    return found if combined is None else found | said(combined)


def judged(outputs: MonitorArrays) -> dict[str, NDArray[Any]]:
    """What the monitors of the links concluded, by the names of the table."""
    return grouped("residual", {name: getattr(outputs, name) for name in MonitorOutput._fields})


def said(fields: CombinedFields) -> dict[str, NDArray[Any]]:
    """What only monitors say that draw one conclusion from several tests."""
    return {
        **grouped("verdict", fields.verdict),
        **grouped("own_residual", fields.local),
        **grouped("input", fields.inputs),
    }


def _write_latched(writer: BagWriter, designs: RunDesigns, records: Mapping[int, Sequence[HistoryRecord]]) -> None:
    for dgu in designs.topics.dgus:
        history = designs.topics.history(dgu)
        for record in records[dgu]:
            writer.write(history.topic.name, 0, history.encode(record))
    for codec, design in designs.messages():
        writer.write(codec.topic.name, 0, codec.encode(design))
