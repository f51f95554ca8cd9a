"""Foreign recordings -> bags of histories and of received streams."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from bags.foreign.gridding import Grid, put_on_grid
from bags.foreign.mapping import HistoryMapping, Mapping, Signal
from bags.foreign.recordings import read_recordings
from bags.mcap.errors import BagError
from bags.mcap.writer import BagWriter
from bags.mcap.yaml_text import dump
from bags.runs.origin import MONITOR_ATTACHMENT, attach_versions
from bags.watch.histories import read_all_histories
from bags.wire.codecs import OutputCodec
from bags.wire.records import HistoryRecord
from bags.wire.schema import RunTopics, run_topics
from dgu_sim.records import Sample

MAPPING_ATTACHMENT = "mapping.yaml"
REPORT_ATTACHMENT = "import.json"
LONGEST_GAP_ROWS = 100  # a longer gap ends an experiment; a shorter one is NaN in it
_WIDTH = 3  # components of a received output
_SHORTEST = 2  # samples of an experiment

Progress = Callable[[str, int, int], None]


def _silent(_what: str, _done: int, _all: int) -> None:
    """Show nothing."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ImportReport:
    """What became of a foreign recording.

    Attributes:
        out: The bag.
        grids: How it was sampled, by what it became: `history of DGU 1`, `streams`.
        samples: Rows in the bag.
        missing: Rows among them in which something is missing.
        experiments: Of each DGU, how many.
    """

    out: Path
    grids: dict[str, Grid]
    samples: int
    missing: int
    experiments: dict[int, int]

    def sentences(self) -> list[str]:
        """What a person should know, a line each."""
        lines: list[str] = []
        for grid in self.grids.values():
            lines += [line for one in grid.regularities for line in one.sentences() if line not in lines]
            how = "stated" if grid.stated else "detected"
            lines += [line for line in [f"sampling period {grid.period_ns * 1e-9:g} s ({how})"] if line not in lines]
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
        }


def import_histories(source: Path, mapping: Mapping, out: Path, progress: Progress = _silent) -> ImportReport:
    """Write the experiments that a mapping names as a bag of histories, from which monitors are designed.

    Args:
        source: Bag or table.
        mapping: Its `histories` say what is what.
        out: The bag's directory; must not exist.
        progress: Called with what is done, how much of it and of how much.

    Raises:
        BagError: The source does not hold what the mapping names, its sampling is irregular, or the bag cannot be
            written: one line.
    """
    if not mapping.histories:
        raise BagError(f"{source}: the mapping has no key histories, expected what to make histories of")
    _check_absent(out)
    grids: dict[str, Grid] = {}
    found: dict[int, list[dict[str, NDArray[np.float64]]]] = {}
    period = mapping.period_ns
    for position, one in enumerate(mapping.histories):
        signals = [signal for table in one.tables.values() for signal in table]
        grid = _gridded(
            source, signals, mapping, window_sec=(one.start_sec, one.stop_sec), period_ns=period, progress=progress
        )
        period = grid.period_ns
        pieces = _experiments(grid, one)
        if not pieces:
            raise BagError(f"{source}: histories.{position} has no two consecutive samples, expected more")
        found.setdefault(one.dgu, []).extend(pieces)
        grids[f"histories.{position}"] = grid
    records = [
        HistoryRecord(
            dgu=dgu, experiment=number, experiments=len(pieces), sampling_period_sec=(period or 0) * 1e-9, **one
        )
        for dgu, pieces in sorted(found.items())
        for number, one in enumerate(pieces)
    ]
    report = ImportReport(
        out=out,
        grids=grids,
        samples=sum(len(record.y) for record in records),
        missing=sum(int((~np.isfinite(np.hstack([record.y, record.x]))).any(axis=1).sum()) for record in records),
        experiments={dgu: len(pieces) for dgu, pieces in found.items()},
    )
    topics = run_topics(sorted(found), (), 1)
    codecs = {dgu: topics.history(dgu) for dgu in topics.dgus}
    with BagWriter(
        out, [codec.topic for codec in codecs.values()], custom_data={"imported_from": source.name}
    ) as writer:
        _attach(writer, mapping, report)
        for record in records:
            writer.write(codecs[record.dgu].topic.name, 0, codecs[record.dgu].encode(record))
    return report


def import_streams(
    source: Path, mapping: Mapping, out: Path, history: Path | None = None, progress: Progress = _silent
) -> ImportReport:
    """Write the received outputs that a mapping names as a bag that `dcmg replay` monitors.

    Args:
        source: Bag or table.
        mapping: Its `streams` say what is what; its `monitor` goes into the bag.
        out: The bag's directory; must not exist.
        history: Bag with histories of the watched DGUs, to be copied into the bag; None: a replay must name one.
        progress: As for `import_histories`.

    Raises:
        BagError: As `import_histories`.
    """
    if not mapping.streams:
        raise BagError(f"{source}: the mapping has no key streams, expected what to make received streams of")
    _check_absent(out)
    sources = {one.ends.source for one in mapping.streams}
    histories = [] if history is None else [one for one in read_all_histories(history) if one.dgu in sources]
    signals = [signal for one in mapping.streams for signal in one.signals]
    window = (mapping.start_sec, mapping.stop_sec)
    grid = _gridded(
        source, signals, mapping, window_sec=window, period_ns=mapping.period_ns, progress=progress, common=False
    )
    links = [one.ends for one in mapping.streams]
    topics = run_topics(sorted({end for link in links for end in (link.source, link.target)}), links, grid.period_ns)
    samples = {one.ends: _samples(grid, one.y, one.delivered) for one in mapping.streams}
    columns = [(topics.received(link), *samples[link]) for link in topics.links]
    report = ImportReport(
        out=out,
        grids={"streams": grid},
        samples=len(grid.present),
        missing=int((~np.stack([delivered for _, _, delivered in columns])).any(axis=0).sum()),
        experiments={dgu: sum(one.dgu == dgu for one in histories) for dgu in sorted(sources) if histories},
    )
    codecs = {one.dgu: topics.history(one.dgu) for one in histories}
    announced = [*topics.heard, *(codec.topic for codec in codecs.values())]
    custom = {"imported_from": source.name, "start_ns": str(grid.start_ns)}
    with BagWriter(out, announced, custom_data=custom) as writer:
        _attach(writer, mapping, report)
        for record in histories:
            writer.write(codecs[record.dgu].topic.name, 0, codecs[record.dgu].encode(record))
        _write_steps(writer, topics, columns, progress)
    return report


def _gridded(
    source: Path,
    signals: Sequence[Signal],
    mapping: Mapping,
    *,
    window_sec: tuple[float, float | None],
    period_ns: int | None,
    progress: Progress,
    common: bool = True,
) -> Grid:
    fields = list(dict.fromkeys(signal.field for signal in signals))
    recordings = read_recordings(source, fields, mapping, lambda done, total: progress("reading", done, total))
    return put_on_grid(
        source,
        recordings,
        mapping.sampling,
        period_ns,
        window_sec=window_sec,
        common=common,
        progress=lambda done, total: progress("sampling", done, total),
    )


def _experiments(grid: Grid, mapping: HistoryMapping) -> list[dict[str, NDArray[np.float64]]]:
    """Tables of each stretch between long gaps; within it, what is missing is NaN."""
    present = np.flatnonzero(grid.present.any(axis=1))
    if not len(present):
        return []
    cuts = np.flatnonzero(np.diff(present) > LONGEST_GAP_ROWS) + 1
    tables = {name: grid.table(signals) for name, signals in mapping.tables.items()}
    spans = [(int(part[0]), int(part[-1]) + 1) for part in np.split(present, cuts)]
    return [
        {name: table[start:end] for name, table in tables.items()} for start, end in spans if end - start >= _SHORTEST
    ]


def _samples(
    grid: Grid, y: Sequence[Signal], delivered: Signal | None
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Received vectors, shape (rows, 3), NaN beyond the outputs that are sent, and whether each was delivered."""
    vectors = np.full((len(grid.present), _WIDTH), np.nan)
    vectors[:, : len(y)] = grid.table(y)
    arrived = grid.all_present([*y, *([delivered] if delivered else [])])
    if delivered is not None:
        said = grid.table([delivered])[:, 0]
        arrived = arrived & np.isfinite(said) & (said != 0.0)
    return vectors, arrived


def _write_steps(
    writer: BagWriter,
    topics: RunTopics,
    columns: Sequence[tuple[OutputCodec, NDArray[np.float64], NDArray[np.bool_]]],
    progress: Progress,
) -> None:
    clock, tick = topics.clock(), topics.tick()
    rows = len(columns[0][2])
    for step in range(rows):
        stamp = topics.stamp_ns(step)
        writer.write(clock.topic.name, stamp, clock.encode(step))
        writer.write(tick.topic.name, stamp, tick.encode(step))
        for codec, vectors, arrived in columns:
            vector = vectors[step].tolist()
            sample = Sample(y=(vector[0], vector[1], vector[2]), delivered=bool(arrived[step]))
            writer.write(codec.topic.name, stamp, codec.encode(step, sample))
        if step % 1000 == 0:
            progress("writing", step, rows)


def attach_mapping(writer: BagWriter, mapping: Mapping) -> None:
    """Put a mapping, its monitor section for replays, and the versions into a bag.

    Raises:
        BagError: The disk refuses.
    """
    writer.attach(MAPPING_ATTACHMENT, dump(mapping.model_dump(mode="json")).encode(), "application/yaml")
    writer.attach(MONITOR_ATTACHMENT, dump(mapping.monitor.model_dump(mode="json")).encode(), "application/yaml")
    attach_versions(writer)


def _attach(writer: BagWriter, mapping: Mapping, report: ImportReport) -> None:
    attach_mapping(writer, mapping)
    writer.attach(REPORT_ATTACHMENT, json.dumps(report.document(), indent=1).encode(), "application/json")


def _check_absent(out: Path) -> None:
    if out.exists():
        raise BagError(f"{out}: exists already, expected the path of a bag to be made")
