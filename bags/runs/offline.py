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
from bags.runs.origin import attach_origin
from bags.runs.team_offline import TeamProgress, fill_team, write_team_documents
from bags.watch.combined_arrays import CombinedFields
from bags.watch.designs import RunDesigns, design_scenario
from bags.watch.histories import grid_history_of_run, histories_of_run, recorded_states
from bags.watch.monitors import MonitorArrays
from bags.wire.combined_topics import CombinedTopics
from bags.wire.records import HistoryRecord
from bags.wire.schema import RunTopics
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import Block

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
            fill_rows(rows, topics, block, outputs)
            if combined is not None:
                fill_combined_rows(rows, topics, block, combined)
            told, events = events_of(topics, block, outputs, told, combined)
            for one in block.doubled:
                second = topics.second(topics.links[one.position]).topic
                if second.name not in writer.counts:
                    writer.add_topic(second)
            if team is not None:
                fill_team(rows, team, block, events)
            cuts = [0, *sorted({row + 1 for row in events} - {len(rows)}), len(rows)]
            for start, end in pairwise(cuts):
                writer.write_block(layout, rows[start:end])
                stamp_ns = topics.stamp_ns(block.first_step + end - 1)
                for topic, data in events.get(end - 1, ()):
                    writer.write(topic.name, stamp_ns, data)
            if progress is not None:
                progress(block.first_step + len(rows))
    return path


def _team(scenario: Scenario, designs: RunDesigns) -> TeamProgress | None:
    if designs.team is None:
        return None
    return TeamProgress(team=designs.team, histories=tuple(grid_history_of_run(scenario)))


def fill_rows(rows: NDArray[np.void], topics: RunTopics, block: Block, outputs: MonitorArrays) -> None:
    """Write the numbers of a block of steps into its messages.

    Args:
        rows: Rows as `BlockFormat.block` makes them, shape (steps,).
        topics: The topics of the run.
        block: States and outputs of one run.
        outputs: What the monitors concluded.
    """
    state = {name: getattr(block, name)[:, 0] for name in ("x", "load_current", "reference", "alpha")}
    sent = {"y": block.y[:, 0], "delivered": np.ones(block.alpha[:, 0].shape, dtype=np.bool_)}
    received = dict(zip(("y", "delivered"), relayed_of(block), strict=True))
    concluded = {name: getattr(outputs, name) for name in ("phase", "alarm", "estimate", "residual", "threshold")}
    for position, dgu in enumerate(topics.dgus):
        _fill(rows[topics.state(dgu).topic.name], state, {"dgu": dgu}, position)
        _fill(rows[topics.output(dgu).topic.name], sent, {"source": dgu}, position)
    for position, link in enumerate(topics.links):
        _fill(rows[topics.received(link).topic.name], received, {"source": link.source}, position)
        numbers = {"source": link.source, "monitor": link.target}
        _fill(rows[topics.residual(link).topic.name], concluded, numbers, position)


def fill_combined_rows(rows: NDArray[np.void], run: RunTopics, block: Block, fields: CombinedFields) -> None:
    """Write into their messages what only monitors say that draw one conclusion from several tests.

    Args:
        rows: As for `fill_rows`.
        run: The topics of the run.
        block: States and outputs of one run.
        fields: What the monitors said.
    """
    topics = run.combined
    assert topics is not None  # noqa: S101 - whoever has the fields has the topics
    own = {"y": block.y[:, 0], "reference": block.reference[:, 0]}
    for monitor in topics.monitors if topics.parts.local else ():
        _fill(rows[topics.own(monitor).topic.name], own, {"dgu": monitor}, run.dgus.index(monitor))
    numbers = combined_numbers(topics)
    for name, arrays in fields.by_topic(topics):
        for field, array in (arrays | numbers[name]).items():
            rows[name][field] = array


def combined_numbers(topics: CombinedTopics) -> dict[str, dict[str, int]]:
    """The numbers that do not change in the messages of `fill_combined_rows`, by topic."""
    numbers = {topics.verdict(monitor).topic.name: {"monitor": monitor} for monitor in topics.monitors}
    numbers |= {topics.residual(one).topic.name: {"source": one, "monitor": one} for one in topics.monitors}
    numbers |= {topics.input(one).topic.name: {"source": one.source, "monitor": one.target} for one in topics.links}
    return numbers


def _fill(
    messages: NDArray[np.void], arrays: Mapping[str, NDArray[Any]], numbers: Mapping[str, int], position: int
) -> None:
    for name, array in arrays.items():
        messages[name] = array[:, position]
    for name, number in numbers.items():
        messages[name] = number


def _write_latched(writer: BagWriter, designs: RunDesigns, records: Mapping[int, Sequence[HistoryRecord]]) -> None:
    for dgu in designs.topics.dgus:
        history = designs.topics.history(dgu)
        for record in records[dgu]:
            writer.write(history.topic.name, 0, history.encode(record))
    for codec, design in designs.messages():
        writer.write(codec.topic.name, 0, codec.encode(design))
