"""A bag, or a run, as files for other programs: CSV, Parquet, netCDF."""

import re
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bags.mcap.bag import Bag, open_bag
from bags.mcap.definitions import Decoder
from bags.mcap.errors import BagError
from bags.sources.recorded import Known, Recorded, open_recorded
from bags.sources.source import Channel
from bags.tables.formulas import harmless
from bags.tables.rows import flattener, is_known, kinds
from bags.tables.table_format import TableFormat
from bags.tables.tabular import library, table_maker, tables, write_netcdf

_ROWS = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportReport:
    """What was exported.

    Attributes:
        files: File of each exported topic, or of the run.
        left_out: Topics that hold no message, or messages that cannot be read.
        unreadable: Why, for those among them that hold messages; how many stands in front.
        notes: What a person should know.
    """

    files: dict[str, Path]
    left_out: tuple[str, ...]
    unreadable: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def export(path: Path | str, out: Path | str, form: TableFormat, known: Known | None = None) -> ExportReport:
    """Write every topic as a table: `time_ns`, then one column a field; or a run as one netCDF file.

    Columns carry the names of the message's fields, `header.stamp.sec`, elements of arrays as `x[0]`; sequences are
    lists in Parquet and JSON in CSV. In CSV, a text that a spreadsheet would execute gets an apostrophe in front.
    Memory stays bounded by one block of messages.

    Args:
        path: Any recording; for netCDF, the directory of a run.
        out: Folder for the files; must not exist, or be empty.
        form: CSV, Parquet or netCDF.
        known: Definitions for what a recording does not define itself.

    Raises:
        BagError: The bag cannot be read, the folder holds something or cannot be written, or a package is missing.
    """
    path, out = Path(path), Path(out)
    bag = _standard_bag(path)
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise BagError(f"{out}: expected a new or empty folder, found one that holds something")
    try:
        if form is TableFormat.NETCDF:
            out.mkdir(parents=True, exist_ok=True)
            return ExportReport(files={"run": write_netcdf(path, out / "run.nc")}, left_out=())
        if bag is None:
            return _export_recorded(path, out, form, known)
        out.mkdir(parents=True, exist_ok=True)
        wanted = [name for name, info in bag.topics.items() if info.count and is_known(info.type_name)]
        unreadable = {
            name: f"{info.count} messages: message type {info.type_name} is unknown"
            for name, info in bag.topics.items()
            if info.count and name not in wanted
        }
        files = file_names(wanted, out, form)
        changed = [_write(bag, topic, files[topic], form) for topic in wanted]
    except OSError as error:
        raise BagError(f"{out}: cannot write the tables ({error.strerror or error})") from error
    return ExportReport(
        files=files,
        left_out=tuple(topic for topic in bag.topics if topic not in files),
        unreadable=unreadable,
        notes=_formula_notes(sum(changed)),
    )


def file_names(topics: Sequence[str], out: Path, form: TableFormat) -> dict[str, Path]:
    """A file for each topic, never one for two: `/a/b` and `/a_b` differ, on file systems without case too."""
    found: dict[str, Path] = {}
    taken: set[str] = set()
    for topic in topics:
        stem = re.sub(r"[^A-Za-z0-9]+", "_", topic.strip("/"))[:150].strip("_") or "topic"
        name, number = stem, 1
        while name.lower() in taken:
            number += 1
            name = f"{stem}_{number}"
        taken.add(name.lower())
        found[topic] = out / f"{name}.{form.value}"
    return found


def _standard_bag(path: Path) -> Bag | None:
    """The bag as our own reader sees it, None for everything that is not laid out as we write it."""
    if not path.is_dir():
        return None
    try:
        bag = open_bag(path)
    except BagError:
        return None
    return (
        bag
        if bag.is_standard() and any(one.type_name.startswith("dcmg_msgs/") for one in bag.topics.values())
        else None
    )


def _write(bag: Bag, topic: str, file: Path, form: TableFormat) -> int:
    """Write one topic; return how many texts were changed."""
    parts = tables(bag, topic, text_lists=form is TableFormat.CSV)
    first = next(parts)
    changed = 0
    with _writer(file, first.schema, form) as writer:
        for part in _chained(first, parts):
            table = part.cast(first.schema)
            if form is TableFormat.CSV:
                table, count = harmless(table)
                changed += count
            writer.write_table(table)
    return changed


def _export_recorded(path: Path, out: Path, form: TableFormat, known: Known | None) -> ExportReport:
    """Any recording in one pass: every topic's rows are collected and written a thousand at a time."""
    with open_recorded(path, known) as recorded:
        counts = {topic: sum(recorded.channels[one] for one in found) for topic, found in recorded.topics.items()}
        unreadable = {
            topic: f"{count} messages: {recorded.unreadable(topic)}"
            for topic, count in counts.items()
            if count and recorded.unreadable(topic)
        }
        several = [topic for topic in counts if topic not in unreadable and not _is_one_table(recorded, topic)]
        unreadable |= {
            topic: f"{counts[topic]} messages: of several definitions, with other fields" for topic in several
        }
        wanted = [topic for topic, count in counts.items() if count and topic not in unreadable]
        out.mkdir(parents=True, exist_ok=True)
        files = file_names(wanted, out, form)
        with ExitStack() as stack:
            writers = {topic: _Rows(recorded, topic, files[topic], form, stack) for topic in wanted}
            for message in recorded.messages([one for topic in wanted for one in recorded.topics[topic]]):
                writers[message.channel.topic].take(message.channel, message.time_ns, message.data)
            for one in writers.values():
                one.flush()
            changed = sum(one.changed for one in writers.values())
        return ExportReport(
            files=files,
            left_out=tuple(topic for topic in counts if topic not in files),
            unreadable=unreadable,
            notes=(*recorded.notes, *_formula_notes(changed)),
        )


def _is_one_table(recorded: Recorded, topic: str) -> bool:
    """Whether the definitions of a topic have the same columns, in whatever order."""
    found = [one for channel in recorded.topics[topic] if not isinstance(one := recorded.decoders[channel], str)]
    return all(_columns(one) == _columns(found[0]) for one in found)


def _columns(decoder: Decoder) -> dict[str, tuple[str, ...]]:
    """Columns by name; of messages inside sequences all fields in their order."""
    found = kinds(decoder)
    whole = (repr(sorted(decoder.fields.items())),)
    return {name: whole if kind == ("struct",) else kind for name, kind in found.items()}


class _Rows:
    """Rows of one topic on their way to its file."""

    def __init__(self, recorded: Recorded, topic: str, file: Path, form: TableFormat, stack: ExitStack) -> None:
        """Start without a file: it is made with the first rows."""
        self._recorded, self._topic, self._file, self._form, self._stack = recorded, topic, file, form, stack
        decoders = {
            one: found for one in recorded.topics[topic] if not isinstance(found := recorded.decoders[one], str)
        }
        self._readers = {one: (found.read, flattener(found)) for one, found in decoders.items()}
        first = next(iter(decoders.values()))
        self._make = table_maker(first, text_lists=form is TableFormat.CSV)
        self._rows: list[dict[str, Any]] = []
        self._writer: Any = None
        self._schema: Any = None
        self.changed = 0

    def take(self, channel: Channel, time_ns: int, data: bytes) -> None:
        """Take one message.

        Raises:
            BagError: It is none.
        """
        try:
            read, flatten = self._readers[channel]
            row = flatten(read(data))
        except BagError as error:
            raise BagError(f"{self._recorded.path}: {self._topic}: {error}") from None
        self._rows.append({"time_ns": time_ns, **row})
        if len(self._rows) >= _ROWS:
            self.flush()

    def flush(self) -> None:
        """Write what is there."""
        if not self._rows:
            return
        table = self._make(self._rows)
        self._rows = []
        if self._form is TableFormat.CSV:
            table, count = harmless(table)
            self.changed += count
        if self._writer is None:
            self._schema = table.schema
            self._writer = self._stack.enter_context(_writer(self._file, table.schema, self._form))
        self._writer.write_table(table.cast(self._schema))


def _writer(file: Path, schema: Any, form: TableFormat) -> Any:  # noqa: ANN401 - pyarrow ships no types
    if form is TableFormat.CSV:
        return library("pyarrow.csv").CSVWriter(str(file), schema)
    return library("pyarrow.parquet").ParquetWriter(str(file), schema)


def _chained(first: Any, others: Iterator[Any]) -> Iterator[Any]:  # noqa: ANN401 - idem
    yield first
    yield from others


def _formula_notes(changed: int) -> tuple[str, ...]:
    if not changed:
        return ()
    return (f"{changed} texts begin like a formula and got an apostrophe in front: spreadsheets would execute them",)
