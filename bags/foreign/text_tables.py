"""Tables as text: separators, decimal commas, rows of units, times, and the many words for a missing value."""

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, final

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
from numpy.typing import NDArray

from bags.foreign.cells import (
    is_missing,
    is_number,
    is_time,
    numbers_of,
    times_of,
)
from bags.foreign.columns import ColumnInfo, ColumnKind
from bags.foreign.units import unit_in_name
from bags.mcap.errors import BagError
from bags.mcap.kinds import check_regular

SUFFIXES: Final = (".csv", ".tsv", ".txt", ".dat", ".csv.gz", ".tsv.gz", ".txt.gz", ".csv.bz2", ".csv.zst")
_SEPARATORS = (",", ";", "\t", "|")
_HEAD_BYTES = 256 * 1024
_HEAD_LINES = 50
_COMMENT = ("#", "%")
_BLOCK_BYTES = 1 << 20
_EXPANSION = 50
_ALWAYS = 200_000_000


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """How a table is written.

    Attributes:
        separator: Between cells.
        decimal: "." or ",".
        encoding: Of the text.
        skipped: Lines before the first row of values: comments, names, units.
        names: Of the columns, without white space around them.
        units: Of the columns, "" where nothing says it.
    """

    separator: str
    decimal: str
    encoding: str
    skipped: int
    names: tuple[str, ...]
    units: tuple[str, ...]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TextTable:
    """A table as text, read in blocks.

    Attributes:
        file: The file, compressed or not.
        dialect: How it is written.
        columns: Its columns.
        rows: Unknown before all is read: -1.
        notes: What a person should know.
    """

    file: Path
    dialect: Dialect
    columns: tuple[ColumnInfo, ...]
    rows: int
    notes: tuple[str, ...]

    def parts(self, names: Sequence[str]) -> Iterator[Mapping[str, NDArray[np.float64] | NDArray[np.int64]]]:
        """Some columns, block by block.

        Raises:
            BagError: A row has more or fewer cells than there are names, or a cell is neither number nor time.
        """
        row = 0
        for block in self._blocks([one for one in range(len(self.columns)) if self.columns[one].name in names]):
            found: dict[str, NDArray[np.float64] | NDArray[np.int64]] = {}
            for position, cells in block.items():
                info = self.columns[position]
                values: NDArray[np.float64] | NDArray[np.int64]
                if info.kind is ColumnKind.TIME:
                    values, wrong = times_of(cells.to_pylist())
                else:
                    values, wrong = numbers_of(cells, self.dialect.decimal)
                if wrong is not None:
                    what = "time" if info.kind is ColumnKind.TIME else "number"
                    raise BagError(
                        f"{self.file}: column {info.name} holds {cells[wrong].as_py()!r} in {self.where(row + wrong)}, "
                        f"expected a {what}, or an empty cell for a missing one"
                    )
                found[info.name] = values
            yield found
            row += len(next(iter(block.values()), ()))

    def where(self, row: int) -> str:
        """The line of a row, as an editor counts it."""
        for number, (line, _) in enumerate(self._lines()):
            if number == row:
                return f"line {line}"
        return f"row {row + 1}"

    def _blocks(self, positions: Sequence[int]) -> Iterator[dict[int, Any]]:
        """The cells of some columns as Arrow strings."""
        dialect = self.dialect
        labels = [str(number) for number in range(len(dialect.names))]
        wanted = [labels[position] for position in positions]
        try:
            with _bounded(self.file) as stream:
                reader = pa_csv.open_csv(
                    stream,
                    read_options=pa_csv.ReadOptions(
                        column_names=labels,
                        skip_rows=dialect.skipped,
                        encoding=dialect.encoding,
                        use_threads=False,
                        block_size=_BLOCK_BYTES,
                    ),
                    parse_options=pa_csv.ParseOptions(delimiter=dialect.separator, newlines_in_values=True),
                    convert_options=pa_csv.ConvertOptions(
                        include_columns=wanted,
                        column_types=dict.fromkeys(labels, pa.string()),
                        strings_can_be_null=False,
                    ),
                )
                for batch in reader:
                    yield {int(name): batch.column(number) for number, name in enumerate(batch.schema.names)}
        except pa.ArrowInvalid as error:
            if str(error).strip().startswith("Empty CSV"):
                return
            raise BagError(self._odd_row() or f"{self.file}: cannot be read ({_line(error)})") from error
        except (OSError, UnicodeDecodeError, EOFError) as error:
            raise BagError(f"{self.file}: cannot be read ({_line(error)})") from error

    def _lines(self) -> Iterator[tuple[int, list[str]]]:
        """Rows of values with the lines in which they end, empty lines left out."""
        with _Bounded(self.file) as stream:
            text = io.TextIOWrapper(
                io.BufferedReader(stream), encoding=self.dialect.encoding, errors="replace", newline=""
            )
            for _ in range(self.dialect.skipped):
                text.readline()
            reader = csv.reader(text, delimiter=self.dialect.separator)
            for row in reader:
                if row:
                    yield reader.line_num + self.dialect.skipped, row

    def _odd_row(self) -> str:
        """What is wrong with the first row whose number of cells is wrong."""
        try:
            for line, row in self._lines():
                if len(row) != len(self.columns):
                    return (
                        f"{self.file}: line {line} has {len(row)} cells, expected {len(self.columns)} as in the first"
                    )
        except (csv.Error, OSError, EOFError) as error:
            return f"{self.file}: cannot be read ({_line(error)})"
        return ""


def open_text(file: Path) -> TextTable:
    """Open a table as text; separator, decimal sign, units and encoding are found out.

    Raises:
        BagError: It cannot be read, or has no row of names.
    """
    check_regular(file)
    try:
        with _bounded(file) as stream:
            raw = stream.read(_HEAD_BYTES)
    except (OSError, EOFError, pa.ArrowInvalid) as error:
        raise BagError(f"{file}: cannot be read ({_line(error)})") from error
    encoding = _encoding(raw)
    text = raw.decode(encoding, "replace").lstrip("\ufeff")
    if "\0" in text:
        raise BagError(f"{file}: holds bytes that are no text, expected a table with names in the first row")
    whole = len(raw) < _HEAD_BYTES
    lines = text.splitlines()[: None if whole else -1]
    skipped, separator = 0, ""
    if lines and (stated := re.fullmatch(r"sep=(.)", lines[0].strip())):
        separator, skipped = stated[1], 1
    while skipped < len(lines) and (not lines[skipped].strip() or lines[skipped].lstrip().startswith(_COMMENT)):
        skipped += 1
    body = lines[skipped : skipped + _HEAD_LINES]
    if not body:
        raise BagError(f"{file}: holds no row of names, expected one")
    separator = separator or _separator(body)
    rows = [row for row in csv.reader(body, delimiter=separator) if row]
    names = tuple(name.strip() for name in rows[0])
    decimal = "," if separator != "," and _decimal_comma(rows[1:]) else "."
    values = rows[1:]
    units = ("",) * len(names)
    skipped += 1
    if _is_unit_row(values, decimal):
        units = tuple(cell.strip().strip("[]()").strip() for cell in values[0])
        units = (*units, *[""] * (len(names) - len(units)))[: len(names)]
        values, skipped = values[1:], skipped + 1
    if all(is_number(name, decimal) for name in names):
        raise BagError(
            f"{file}: the first row holds numbers ({', '.join(names):.60}), expected the names of the columns"
        )
    dialect = Dialect(
        separator=separator, decimal=decimal, encoding=encoding, skipped=skipped, names=names, units=units
    )
    columns = tuple(
        ColumnInfo(
            name=name,
            kind=_kind([row[position] for row in values if position < len(row)], decimal),
            unit=units[position] or unit_in_name(name),
        )
        for position, name in enumerate(names)
    )
    return TextTable(file=file, dialect=dialect, columns=columns, rows=-1, notes=())


def _bounded(file: Path) -> Any:  # noqa: ANN401 - pyarrow ships no types
    """The file as a stream of its decompressed bytes, of which there may not be endlessly many."""
    return pa.PythonFile(_Bounded(file), mode="r")


@final
class _Bounded(io.RawIOBase):
    """A file decompressed on the way."""

    def __init__(self, file: Path) -> None:
        """Open the file."""
        super().__init__()
        self._stream = pa.input_stream(str(file), compression="detect")
        self._left = max(_ALWAYS, _EXPANSION * file.stat().st_size)

    def readable(self) -> bool:
        """It is."""
        return True

    def read(self, size: int = -1) -> bytes:
        """Some bytes.

        Raises:
            OSError: They are too many.
        """
        found = bytes(self._stream.read(size if size >= 0 else None))
        self._left -= len(found)
        if self._left < 0:
            raise OSError("it decompresses to an unreasonable size")
        return found

    def readinto(self, buffer: Any) -> int:  # noqa: ANN401 - a writable buffer
        """Some bytes, into a buffer."""
        found = self.read(len(buffer))
        buffer[: len(found)] = found
        return len(found)


def _encoding(raw: bytes) -> str:
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    try:
        raw[:-4].decode("utf-8")
    except UnicodeDecodeError as error:
        if error.start < len(raw) - 8:
            return "cp1252"
    return "utf-8"


def _separator(lines: Sequence[str]) -> str:
    """The separator that gives every line the same number of cells, the more the better."""

    def score(separator: str) -> tuple[bool, int]:
        counts = [len(row) for row in csv.reader(lines, delimiter=separator) if row]
        same = len(set(counts)) == 1 and counts[0] > 1
        return same, counts[0] if counts else 0

    return max(_SEPARATORS, key=score)


def _decimal_comma(rows: Sequence[Sequence[str]]) -> bool:
    cells = [cell.strip() for row in rows for cell in row]
    return any(re.fullmatch(r"[-+]?\d*,\d+([eE][-+]?\d+)?", cell) for cell in cells)


def _is_unit_row(rows: Sequence[Sequence[str]], decimal: str) -> bool:
    """Whether the first row says in which units the following ones are."""
    if len(rows) < 2:  # noqa: PLR2004 - units, and values to tell them from
        return False
    first = [cell.strip() for cell in rows[0]]
    texts = [cell for cell in first if cell and not is_missing(cell)]
    plain = not any(is_number(cell, decimal) or is_time(cell) for cell in texts)
    below = zip(first, rows[1], strict=False)
    return bool(texts) and plain and any(cell and is_number(under, decimal) for cell, under in below)


def _kind(cells: Sequence[str], decimal: str) -> ColumnKind:
    found = [cell.strip() for cell in cells if not is_missing(cell)]
    if found and all(is_time(cell) for cell in found):
        return ColumnKind.TIME
    numbers = sum(is_number(cell, decimal) for cell in found)
    return ColumnKind.TEXT if found and numbers < len(found) / 2 else ColumnKind.NUMBER


def _line(error: Exception) -> str:
    return f"{' '.join(str(error).split()) or type(error).__name__:.200}"
