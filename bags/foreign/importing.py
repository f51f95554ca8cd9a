"""Foreign recordings -> bags of histories and of received streams."""

import json
import shutil
from array import array
from collections.abc import Callable, Iterator, Sequence
from collections.abc import Mapping as MappingType
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bags.foreign.falsifying import Falsifier, RecordedKnowledge, states_of
from bags.foreign.gridding import Grid, Samples, put_on_grid
from bags.foreign.mapping import HistoryMapping, Mapping, Signal, StreamMapping, stream_widths
from bags.foreign.recordings import read_recordings
from bags.foreign.units import unit_note
from bags.mcap.errors import BagError
from bags.mcap.writer import BagWriter
from bags.mcap.yaml_text import dump
from bags.sources.recorded import Known
from bags.watch.histories import read_all_histories
from bags.wire.documents import HistoryCodec
from bags.wire.origin import MONITOR_ATTACHMENT, attach_versions
from bags.wire.plugins import used_plug_ins
from bags.wire.records import HistoryRecord
from bags.wire.row import Widths
from bags.wire.schema import RunTopics, run_topics
from dgu_sim.errors import AttackError
from dgu_sim.grid import Link
from dgu_sim.records import Sample

MAPPING_ATTACHMENT = "mapping.yaml"
REPORT_ATTACHMENT = "import.json"
LONGEST_GAP_ROWS = 100  # a longer gap ends an experiment; a shorter one is NaN in it
_MOST_BYTES = 16 * 1024 * 1024  # of one experiment, which is one message: its reader holds it several times
_SHORTEST = 2  # samples of an experiment

Progress = Callable[[str, int, int], None]


def _silent(_what: str, _done: int, _all: int) -> None:
    """Show nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportReport:
    """What became of a foreign recording.

    Attributes:
        out: The bag.
        grids: How it was sampled, by what it became: `history of DGU 1`, `streams`.
        samples: Rows in the bag.
        missing: Rows among them in which something is missing.
        experiments: Of each DGU, how many.
        notes: What a person should know besides.
    """

    out: Path
    grids: dict[str, Grid]
    samples: int
    missing: int
    experiments: dict[int, int]
    notes: tuple[str, ...] = ()

    def sentences(self) -> list[str]:
        """What a person should know, a line each."""
        lines: list[str] = [*dict.fromkeys(self.notes)]
        for grid in self.grids.values():
            lines += [line for one in grid.regularities for line in one.sentences() if line not in lines]
            how = "stated" if grid.stated else "detected"
            lines += [line for line in [f"sampling period {grid.period_ns * 1e-9:g} s ({how})"] if line not in lines]
            for name, count in grid.not_finite.items():
                line = f"{name}: {count} samples are no finite numbers and count as missing"
                lines += [line] if line not in lines else []
        return (
            [*lines, f"{self.missing} of {self.samples} samples are missing or incomplete"] if self.missing else lines
        )

    def document(self) -> dict[str, Any]:
        """For a JSON document."""
        return {
            "bag": str(self.out),
            "samples": self.samples,
            "missing": self.missing,
            "experiments": {str(dgu): count for dgu, count in self.experiments.items()},
            "sampling": {name: grid.document() for name, grid in self.grids.items()},
            "notes": list(dict.fromkeys(self.notes)),
        }


def import_histories(
    source: Path, mapping: Mapping, out: Path, *, known: Known | None = None, progress: Progress = _silent
) -> ImportReport:
    """Write the experiments that a mapping names as a bag of histories, from which monitors are designed.

    Args:
        source: Bag or table.
        mapping: Its `histories` say what is what.
        out: The bag's directory; must not exist.
        known: Definitions for what a bag does not define itself.
        progress: Called with what is done, how much of it and of how much.

    Raises:
        BagError: The source does not hold what the mapping names, its sampling is irregular, or the bag cannot be
            written: one line.
    """
    if not mapping.histories:
        raise BagError(f"{source}: the mapping has no key histories, expected what to make histories of")
    _check_absent(out)
    topics = run_topics(sorted({one.dgu for one in mapping.histories}), (), 1)
    job = _Histories(source=source, mapping=mapping, known=known, progress=progress, period_ns=mapping.period_ns)
    announced = [topics.history(dgu).topic for dgu in topics.dgus]
    custom = {"imported_from": source.name}
    with _removed_on_failure(out), BagWriter(out, announced, custom_data=custom) as writer:
        attach_mapping(writer, mapping)
        for dgu in dict.fromkeys(one.dgu for one in mapping.histories):  # in turn: each is as long as the recording
            for data in job.messages(topics.history(dgu)):
                writer.write(topics.history(dgu).topic.name, 0, data)
        report = job.report(out)
        attach_report(writer, report)
    return report


@dataclass(slots=True, kw_only=True)
class _Histories:
    """Makes the histories of one DGU after the other.

    Attributes:
        period_ns: T_s, as stated, or as the first entry has it; None before that.
        grids: How each entry was sampled.
        samples: Rows so far.
        missing: Those among them in which something is missing.
        experiments: Of each DGU so far, how many.
        notes: What a person should know.
    """

    source: Path
    mapping: Mapping
    known: Known | None
    progress: Progress
    period_ns: int | None
    grids: dict[str, Grid] = field(default_factory=dict)
    samples: int = 0
    missing: int = 0
    experiments: dict[int, int] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def messages(self, codec: HistoryCodec) -> Iterator[bytes]:
        """The experiments of a DGU; what went into one is let go before it is written.

        Raises:
            BagError: As `import_histories`.
        """
        pieces: list[dict[str, NDArray[np.float64]]] = []
        for position, one in enumerate(self.mapping.histories):
            if one.dgu == codec.dgu:
                pieces += self._pieces(position, one)
        count = self.experiments[codec.dgu] = len(pieces)
        for number in range(count):
            yield self._message(codec, number, pieces.pop(0))

    def _message(self, codec: HistoryCodec, number: int, tables: dict[str, NDArray[np.float64]]) -> bytes:
        record = HistoryRecord(
            dgu=codec.dgu,
            experiment=number,
            experiments=self.experiments[codec.dgu],
            sampling_period_sec=(self.period_ns or 0) * 1e-9,
            **tables,
        )
        self.samples += len(record.y)
        there = np.isfinite(record.y).all(axis=1) & np.isfinite(record.x).all(axis=1)
        self.missing += int((~there).sum())
        return codec.encode(record)

    def report(self, out: Path) -> ImportReport:
        """What became of the recording."""
        return ImportReport(
            out=out,
            grids=self.grids,
            samples=self.samples,
            missing=self.missing,
            experiments=self.experiments,
            notes=tuple(self.notes),
        )

    def _pieces(self, position: int, mapping: HistoryMapping) -> list[dict[str, NDArray[np.float64]]]:
        signals = [signal for table in mapping.tables.values() for signal in table]
        job = _Job(source=self.source, mapping=self.mapping, known=self.known, progress=self.progress)
        window = (mapping.start_sec, mapping.stop_sec)
        grid, said = job.grid(signals, window_sec=window, period_ns=self.period_ns)
        self.notes += said
        self.period_ns, grid.stated = grid.period_ns, self.mapping.period_ns is not None
        pieces = _experiments(grid.blocks(), mapping)
        if not pieces:
            raise BagError(f"{self.source}: histories.{position} has no two consecutive samples, expected more")
        self.grids[f"histories.{position}"] = grid
        return pieces


def import_streams(
    source: Path,
    mapping: Mapping,
    out: Path,
    history: Path | None = None,
    *,
    known: Known | None = None,
    progress: Progress = _silent,
) -> ImportReport:
    """Write the received outputs that a mapping names as a bag that `dcmg replay` monitors.

    Args:
        source: Bag or table.
        mapping: Its `streams` say what is what; its `monitor` goes into the bag.
        out: The bag's directory; must not exist.
        history: Bag with histories of the watched DGUs, to be copied into the bag; None: a replay must name one.
        known: Definitions for what a bag does not define itself.
        progress: As for `import_histories`.

    Raises:
        BagError: As `import_histories`; what was written until then is removed.
    """
    if not mapping.streams:
        raise BagError(f"{source}: the mapping has no key streams, expected what to make received streams of")
    _check_absent(out)
    sources = {one.ends.source for one in mapping.streams}
    histories = [] if history is None else [one for one in read_all_histories(history) if one.dgu in sources]
    signals = [signal for one in mapping.streams for signal in one.signals]
    job = _Job(source=source, mapping=mapping, known=known, progress=progress)
    grid, notes = job.grid(
        signals, window_sec=(mapping.start_sec, mapping.stop_sec), period_ns=mapping.period_ns, common=False
    )
    links = [one.ends for one in mapping.streams]
    ends = sorted({end for link in links for end in (link.source, link.target)})
    topics = run_topics(ends, links, grid.period_ns, widths=stream_widths(mapping.streams))
    streams = {one.ends: one for one in mapping.streams}
    knowledge = RecordedKnowledge(
        histories=states_of(histories), outputs={link.source: len(one.y) for link, one in streams.items()}
    )
    plans = [one.plan for one in mapping.attacks]
    try:
        falsifier = Falsifier(topics.links, plans, grid.period_ns * 1e-9, knowledge, mapping.seed)
    except AttackError as error:
        raise BagError(f"{source}: {error}") from error
    blocks = grid.blocks()
    first = next(blocks, None)
    if first is None:
        raise BagError(f"{source}: gives no sample, expected some")
    codecs = {one.dgu: topics.history(one.dgu) for one in histories}
    announced = [*topics.heard, *(codec.topic for codec in codecs.values())]
    announced += [topics.attack_events().topic] if plans else []
    custom = {"imported_from": source.name, "start_ns": str(grid.start_ns)}
    with _removed_on_failure(out), BagWriter(out, announced, custom_data=custom) as writer:
        attach_mapping(writer, mapping)
        for record in histories:
            writer.write(codecs[record.dgu].topic.name, 0, codecs[record.dgu].encode(record))
        steps = _Steps(writer, topics, streams, falsifier)
        for block in chain([first], blocks):
            steps.write(block)
        report = ImportReport(
            out=out,
            grids={"streams": grid},
            samples=steps.count,
            missing=steps.missing,
            experiments={dgu: sum(one.dgu == dgu for one in histories) for dgu in sorted(sources) if histories},
            notes=(*notes, *_attack_notes(source, mapping, steps)),
        )
        attach_report(writer, report)
    return report


def _attack_notes(source: Path, mapping: Mapping, steps: "_Steps") -> list[str]:
    """What was falsified; an attack that never acted is no result.

    Raises:
        BagError: One began behind the end of the recording.
    """
    for one in mapping.attacks:
        if one.start_sec >= steps.count * steps.period_sec:
            raise BagError(
                f"{source}: the {one.kind} attack starts at {one.start_sec:g} s, expected a time before the end of the "
                f"recording at {steps.count * steps.period_sec:g} s"
            )
    return [
        f"falsified: {one.kind} on {', '.join(one.link_names)} from {one.start_sec:g} s "
        f"{'to the end' if one.stop_sec is None else f'to {one.stop_sec:g} s'}"
        for one in mapping.attacks
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Job:
    """Reads a source."""

    source: Path
    mapping: Mapping
    known: Known | None
    progress: Progress

    def grid(
        self,
        signals: Sequence[Signal],
        *,
        window_sec: tuple[float, float | None],
        period_ns: int | None,
        common: bool = True,
    ) -> tuple[Grid, list[str]]:
        """Signals on their way onto a grid, and what a person should know."""
        fields = list(dict.fromkeys(signal.field for signal in signals))
        read = read_recordings(
            self.source, fields, self.mapping, self.known, lambda done, total: self.progress("reading", done, total)
        )
        bare = {signal.field for signal in signals if signal.is_bare}
        units = [unit_note(name, one.unit_of(name)) for one in read.recordings for name in one.fields if name in bare]
        grid = put_on_grid(
            self.source,
            read.recordings,
            self.mapping.sampling,
            period_ns,
            window_sec=window_sec,
            common=common,
            progress=lambda done, total: self.progress("sampling", done, total),
        )
        return grid, [*read.notes, *(one for one in units if one)]


def _experiments(blocks: Iterator[Samples], mapping: HistoryMapping) -> list[dict[str, NDArray[np.float64]]]:
    """Tables of each stretch between long gaps, or of what one message may hold; within it, what is missing is NaN."""
    distinct = {signals: array("d") for signals in mapping.tables.values()}  # outputs that are the states: once
    there: list[NDArray[np.bool_]] = []
    for block in blocks:
        there.append(np.asarray(block.present.any(axis=1), dtype=np.bool_))
        for signals, numbers in distinct.items():
            numbers.frombytes(np.ascontiguousarray(block.table(signals)).tobytes())
    present = np.flatnonzero(np.concatenate(there)) if there else np.empty(0, dtype=np.intp)
    if not len(present):
        return []
    rows = sum(len(one) for one in there)
    tables = {name: _table(distinct[signals], rows, len(signals)) for name, signals in mapping.tables.items()}
    cuts = np.flatnonzero(np.diff(present) > LONGEST_GAP_ROWS) + 1
    spans = [(int(part[0]), int(part[-1]) + 1) for part in np.split(present, cuts)]
    most = max(_MOST_BYTES // max(8 * sum(table.shape[1] for table in tables.values()), 1), _SHORTEST)
    return [
        {name: table[first:last] for name, table in tables.items()}
        for start, end in spans
        if end - start >= _SHORTEST
        for first, last in pairwise(np.linspace(start, end, -(-(end - start) // most) + 1).round().astype(int).tolist())
    ]


def _table(numbers: "array[float]", rows: int, columns: int) -> NDArray[np.float64]:
    """Numbers as a table, in place."""
    return np.frombuffer(numbers, dtype=np.float64).reshape(rows, columns) if numbers else np.empty((rows, columns))


class _Steps:
    """Writes rows as the steps of a run."""

    def __init__(
        self, writer: BagWriter, topics: RunTopics, streams: MappingType[Link, StreamMapping], falsifier: Falsifier
    ) -> None:
        """Start at step 0."""
        self._writer, self._topics, self._falsifier = writer, topics, falsifier
        self._streams = [(topics.received(link), streams[link]) for link in topics.links]
        self.count, self.missing = 0, 0

    def write(self, block: Samples) -> None:
        """Write one block: a sample of which anything is missing or no finite number is not delivered."""
        clock, tick = self._topics.clock(), self._topics.tick()
        events = self._topics.attack_events()
        widths = self._topics.widths
        columns = [(codec, *_samples(block, one, widths)) for codec, one in self._streams]
        arrived = np.stack([delivered for _, _, delivered in columns])
        self.missing += int((~arrived).any(axis=0).sum())
        for row in range(len(block.values)):
            stamp = self._topics.stamp_ns(self.count)
            self._writer.write(clock.topic.name, stamp, clock.encode(self.count))
            self._writer.write(tick.topic.name, stamp, tick.encode(self.count))
            sent = [
                Sample(y=tuple(one[: widths.outputs]), delivered=bool(there[row]), u=tuple(one[widths.outputs :]))
                for _, vectors, there in columns
                for one in [vectors[row].tolist()]
            ]
            received, told = self._falsifier.step(sent)
            for (codec, _, _), sample in zip(columns, received, strict=True):
                self._writer.write(codec.topic.name, stamp, codec.encode(self.count, sample))
            for event in told:
                self._writer.write(events.topic.name, stamp, events.encode(event))
            self.count += 1

    @property
    def period_sec(self) -> float:
        """T_s [s]."""
        return self._topics.sampling_period_ns * 1e-9


def _samples(block: Samples, stream: StreamMapping, widths: Widths) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Outputs and known inputs side by side, shape (rows, p + m), NaN beyond what is sent, and what was delivered."""
    signals = (*stream.y, *stream.u)
    vectors = np.full((len(block.values), widths.outputs + widths.inputs), np.nan)
    vectors[:, : len(stream.y)] = block.table(stream.y)
    if stream.u:
        vectors[:, widths.outputs : widths.outputs + len(stream.u)] = block.table(stream.u)
    arrived = block.delivered(signals) & np.isfinite(block.table(signals)).all(axis=1)
    if stream.delivered is not None:
        said = block.table([stream.delivered])[:, 0]
        arrived = arrived & block.delivered([stream.delivered]) & (said != 0.0)
    return vectors, arrived


def attach_mapping(writer: BagWriter, mapping: Mapping) -> None:
    """Put a mapping, its monitor section for replays, and the versions into a bag.

    Raises:
        BagError: The disk refuses.
    """
    writer.attach(MAPPING_ATTACHMENT, dump(mapping.model_dump(mode="json")).encode(), "application/yaml")
    writer.attach(MONITOR_ATTACHMENT, dump(mapping.monitor.model_dump(mode="json")).encode(), "application/yaml")
    attach_versions(writer, used_plug_ins({"monitor": mapping.monitor.model_dump(mode="json")}))


def attach_report(writer: BagWriter, report: ImportReport) -> None:
    """Put what became of a recording into the bag."""
    writer.attach(REPORT_ATTACHMENT, json.dumps(report.document(), indent=1).encode(), "application/json")


@contextmanager
def _removed_on_failure(out: Path) -> Iterator[None]:
    """Leave no half of a bag behind."""
    try:
        yield
    except BaseException:
        shutil.rmtree(out, ignore_errors=True)
        raise


def _check_absent(out: Path) -> None:
    if out.exists():
        raise BagError(f"{out}: exists already, expected the path of a bag to be made")
