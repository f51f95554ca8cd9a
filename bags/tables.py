"""Tables of measurements from outside (CSV, Parquet) as the history of a DGU."""

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import final

import numpy as np
from numpy.typing import NDArray

from bags.errors import BagError
from bags.records import HistoryRecord
from bags.schema import run_topics
from bags.writer import BagWriter

_COLUMN = re.compile(r"(?P<name>.+?)(?:\*(?P<factor>[-+0-9.eE]+))?")
_JITTER = 0.01  # share of the sampling period by which an instant may be off and still count as regular


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column of a table and the factor that brings it to SI units.

    Attributes:
        name: As in the table's first row.
        factor: SI value of one unit of the column.
    """

    name: str
    factor: float = 1.0

    @classmethod
    def parse(cls, text: str) -> "Column":
        """From `name` or `name*factor`, as in `current_ma*0.001`.

        Raises:
            BagError: The factor is no number.
        """
        match = _COLUMN.fullmatch(text.strip())
        try:
            return cls(name=match["name"].strip(), factor=float(match["factor"] or 1.0)) if match else cls(name="")
        except ValueError:
            raise BagError(f"column {text!r}: expected a name, or name*factor with a number") from None


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TableMapping:
    """Which columns are what.

    Attributes:
        time: Instants, None: the rows are regular and `sampling_period_sec` is given.
        u: Known inputs, may be empty.
        y: Outputs as they are sent over the network.
        x: States; empty: the outputs are the states.
        sampling_period_sec: T_s [s], None: the median of the time column's steps.
    """

    y: tuple[Column, ...]
    x: tuple[Column, ...] = ()
    u: tuple[Column, ...] = ()
    time: Column | None = None
    sampling_period_sec: float | None = None


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TableReport:
    """What became of a table.

    Attributes:
        records: The experiments: the table is cut where samples are missing.
        rows: Rows of the table.
        gaps: Row behind each gap and its length [s].
        dropped: Rows in pieces of a single sample, which say nothing about the dynamics.
    """

    records: tuple[HistoryRecord, ...]
    rows: int
    gaps: tuple[tuple[int, float], ...]
    dropped: int


def read_history_table(file: Path, dgu: int, mapping: TableMapping) -> TableReport:
    """Turn a table of measurements into the experiments of a history.

    Args:
        file: `*.csv` with names in the first row, or `*.parquet` (needs pyarrow).
        dgu: Number of the DGU it is about.
        mapping: Which columns are what.

    Raises:
        BagError: The file cannot be read, a column is missing or holds something besides numbers, or the sampling is
            irregular: it is never resampled silently.
    """
    names = {one.name for one in (*mapping.u, *mapping.y, *mapping.x, *([mapping.time] if mapping.time else []))}
    table = _read(file, sorted(names))
    rows = len(next(iter(table.values())))
    period, gaps = _sampling(file, table, mapping, rows)
    parts = np.split(np.arange(rows), [row for row, _ in gaps])
    kept = [part for part in parts if len(part) > 1]
    arrays = {name: _matrix(table, columns, rows) for name, columns in (("u", mapping.u), ("y", mapping.y))}
    arrays["x"] = _matrix(table, mapping.x or mapping.y, rows)
    arrays["d"] = arrays["w"] = np.empty((rows, 0))
    records = tuple(
        HistoryRecord(
            dgu=dgu,
            experiment=number,
            experiments=len(kept),
            sampling_period_sec=period,
            **{name: array[part] for name, array in arrays.items()},
        )
        for number, part in enumerate(kept)
    )
    return TableReport(records=records, rows=rows, gaps=gaps, dropped=rows - sum(len(part) for part in kept))


def import_history(file: Path, dgu: int, mapping: TableMapping, out: Path) -> TableReport:
    """Write a table of measurements as a bag of histories, from which monitors are designed.

    Args:
        file: As for `read_history_table`.
        dgu: Number of the DGU.
        mapping: Which columns are what.
        out: The bag's directory; must not exist.

    Raises:
        BagError: As for `read_history_table`, too few samples, or the bag cannot be written.
    """
    report = read_history_table(file, dgu, mapping)
    if not report.records:
        raise BagError(f"{file}: holds {report.rows} rows, expected two consecutive samples or more")
    codec = run_topics((dgu,), (), 1).history(dgu)
    with BagWriter(out, [codec.topic], custom_data={"imported_from": file.name}) as writer:
        for record in report.records:
            writer.write(codec.topic.name, 0, codec.encode(record))
    return report


def _matrix(table: Mapping[str, NDArray[np.float64]], columns: Sequence[Column], rows: int) -> NDArray[np.float64]:
    found = [table[one.name] * one.factor for one in columns]
    return np.stack(found, axis=1) if found else np.zeros((rows, 0))


def _sampling(
    file: Path, table: Mapping[str, NDArray[np.float64]], mapping: TableMapping, rows: int
) -> tuple[float, tuple[tuple[int, float], ...]]:
    """T_s [s] and the gaps, each a whole number of missing samples."""
    if mapping.time is None:
        if mapping.sampling_period_sec is None or not mapping.sampling_period_sec > 0.0:
            raise BagError(f"{file}: found no time column, expected a positive sampling period instead")
        return mapping.sampling_period_sec, ()
    if rows < 2:  # noqa: PLR2004 - a period lies between two instants
        raise BagError(f"{file}: holds {rows} rows, expected two consecutive samples or more")
    steps = np.diff(table[mapping.time.name] * mapping.time.factor)
    period = mapping.sampling_period_sec or float(np.median(steps))
    if not period > 0.0:
        raise BagError(f"{file}: column {mapping.time.name} steps by {period:g} s, expected ascending instants")
    whole = np.rint(steps / period)
    wrong = np.flatnonzero((whole < 1) | (abs(steps - whole * period) > _JITTER * period))
    if len(wrong):
        row = int(wrong[0])
        raise BagError(
            f"{file}: irregular sampling, {len(wrong)} of {len(steps)} steps are no multiple of {period:g} s, the "
            f"first one {steps[row]:g} s before row {row + 1}: resample it, or give the sampling period"
        )
    return period, tuple((int(row) + 1, float(steps[row])) for row in np.flatnonzero(whole > 1))


def _read(file: Path, names: Sequence[str]) -> dict[str, NDArray[np.float64]]:
    try:
        columns = _parquet(file) if file.suffix == ".parquet" else _csv(file)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise BagError(f"{file}: cannot be read ({error})") from error
    found: dict[str, NDArray[np.float64]] = {}
    for name in names:
        if name not in columns:
            raise BagError(f"{file}: has no column {name!r}, found {', '.join(columns):.200}")
        try:
            found[name] = np.asarray(columns[name], dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise BagError(f"{file}: column {name} holds something besides numbers ({error})") from error
        if not np.isfinite(found[name]).all():
            row = int(np.flatnonzero(~np.isfinite(found[name]))[0])
            raise BagError(f"{file}: column {name} holds {found[name][row]} in row {row}, expected a number")
    return found


def _csv(file: Path) -> dict[str, list[str]]:
    with file.open(newline="", encoding="utf-8-sig") as stream:
        rows = [row for row in csv.reader(stream) if row]
    head = [name.strip() for name in rows[0]] if rows else []
    for number, row in enumerate(rows[1:]):
        if len(row) != len(head):
            raise BagError(f"{file}: row {number} has {len(row)} cells, expected {len(head)}")
    return {name: [row[position] for row in rows[1:]] for position, name in enumerate(head)}


def _parquet(file: Path) -> dict[str, list[object]]:
    try:
        parquet = import_module("pyarrow.parquet")
    except ImportError as error:
        raise BagError("Parquet needs the Python package pyarrow, found none: pip install pyarrow") from error
    try:
        table = parquet.read_table(file)
    except OSError:
        raise
    except Exception as error:  # pyarrow raises its own kinds for what is no Parquet
        raise BagError(f"{file}: is no Parquet file ({' '.join(str(error).split())})") from error
    return {str(name): table[name].to_pylist() for name in table.column_names}
