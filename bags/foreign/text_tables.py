"""Tables as text: separators, decimal commas, rows of units, times, and the many words for a missing value."""

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any, Final

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
from bags.foreign.dialect import BLANK, Dialect, dialect_of, rows_of
from bags.foreign.units import unit_in_name
from bags.mcap.errors import BagError
from bags.mcap.kinds import check_regular

SUFFIXES: Final = (".csv", ".tsv", ".txt", ".dat", ".csv.gz", ".tsv.gz", ".txt.gz", ".csv.bz2", ".csv.zst")
_HEAD_BYTES = 256 * 1024
_BLOCK_BYTES = 1 << 20
_TOO_LARGE = "it decompresses to an unreasonable size"
_EXPANSION = 50
_ALWAYS = 200_000_000


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
                    what = self._expected(info.kind, str(cells[wrong].as_py()))
                    raise BagError(
                        f"{self.file}: column {info.name} holds {cells[wrong].as_py()!r} in {self.where(row + wrong)}, "
                        f"expected {what}, or an empty cell for a missing one"
                    )
                found[info.name] = values
            yield found
            row += len(next(iter(block.values()), ()))

    def _expected(self, kind: ColumnKind, cell: str) -> str:
        if kind is ColumnKind.TIME or re.search(r"\d[:/]\d", cell):
            return "a time as in 2025-03-30T00:59:59.010+02:00"
        sign = {".": "point", ",": "comma"}[self.dialect.decimal]
        return f"a number (with a decimal {sign}, nothing between thousands, no unit)" if len(cell) > 1 else "a number"

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
            most = _most_bytes(self.file)
            with _native(self.file, blanks=dialect.separator == BLANK) as stream:
                reader = pa_csv.open_csv(
                    stream,
                    read_options=pa_csv.ReadOptions(
                        column_names=labels,
                        skip_rows=dialect.skipped,
                        encoding=dialect.encoding,
                        use_threads=False,
                        block_size=_BLOCK_BYTES,
                    ),
                    parse_options=pa_csv.ParseOptions(
                        delimiter="\t" if dialect.separator == BLANK else dialect.separator, newlines_in_values=True
                    ),
                    convert_options=pa_csv.ConvertOptions(
                        include_columns=wanted,
                        column_types=dict.fromkeys(labels, pa.string()),
                        strings_can_be_null=False,
                    ),
                )
                for batch in reader:
                    _check_size(stream.tell(), most)
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
            for line, row in rows_of(text, self.dialect.separator):
                yield line + self.dialect.skipped, row

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
        with _Bounded(file) as stream:
            raw = stream.read(_HEAD_BYTES)
    except (OSError, EOFError, pa.ArrowInvalid) as error:
        raise BagError(f"{file}: cannot be read ({_line(error)})") from error
    try:
        dialect, values = dialect_of(raw, whole=len(raw) < _HEAD_BYTES)
    except BagError as error:
        raise BagError(f"{file}: {error}") from None
    columns = tuple(
        ColumnInfo(
            name=name,
            kind=_kind([row[position] for row in values if position < len(row)], dialect.decimal),
            unit=dialect.units[position] or unit_in_name(name),
        )
        for position, name in enumerate(dialect.names)
    )
    return TextTable(file=file, dialect=dialect, columns=columns, rows=-1, notes=())


@contextmanager
def _native(file: Path, *, blanks: bool) -> Iterator[Any]:
    """The decompressed bytes as a stream of Arrow's own: it is read ahead in a thread, which must not need Python.

    Args:
        file: The file.
        blanks: Whether blanks separate its cells: one tab takes the place of any number of them.
    """
    if not blanks:
        with pa.input_stream(str(file), compression="detect") as stream:
            yield stream
        return
    with NamedTemporaryFile(prefix="dcmg_table_") as tabbed:
        written = _Tabbed(file)
        while piece := written.read(_BLOCK_BYTES):
            tabbed.write(piece)
        tabbed.flush()
        with pa.input_stream(tabbed.name, compression=None) as stream:
            yield stream


def _check_size(found: int, most: int) -> None:
    if found > most:
        raise OSError(_TOO_LARGE)


def _most_bytes(file: Path) -> int:
    """What a file may decompress to."""
    return int(max(_ALWAYS, _EXPANSION * file.stat().st_size))


class _Bounded(io.RawIOBase):
    """A file decompressed on the way."""

    def __init__(self, file: Path) -> None:
        """Open the file."""
        super().__init__()
        self._stream = pa.input_stream(str(file), compression="detect")
        self._left = _most_bytes(file)

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
            raise OSError(_TOO_LARGE)
        return found

    def readinto(self, buffer: Any) -> int:  # noqa: ANN401 - a writable buffer
        """Some bytes, into a buffer."""
        found = self.read(len(buffer))
        buffer[: len(found)] = found
        return len(found)


class _Tabbed(io.RawIOBase):
    """A file with one tab wherever it has blanks between cells, and none around a line."""

    def __init__(self, file: Path) -> None:
        """Open the file."""
        super().__init__()
        self._lines = io.BufferedReader(_Bounded(file), _BLOCK_BYTES)
        self._ready = bytearray()

    def readable(self) -> bool:
        """It is."""
        return True

    def read(self, size: int = -1) -> bytes:
        """Some bytes."""
        while size < 0 or len(self._ready) < size:
            line = self._lines.readline()
            if not line:
                break
            self._ready += b"\t".join(line.split()) + b"\n"
        found = bytes(self._ready if size < 0 else self._ready[:size])
        del self._ready[: len(found)]
        return found


def _kind(cells: Sequence[str], decimal: str) -> ColumnKind:
    found = [cell.strip() for cell in cells if not is_missing(cell)]
    if found and all(is_time(cell) for cell in found):
        return ColumnKind.TIME
    numbers = sum(is_number(cell, decimal) for cell in found)
    return ColumnKind.TEXT if found and numbers < len(found) / 2 else ColumnKind.NUMBER


def _line(error: Exception) -> str:
    return f"{' '.join(str(error).split()) or type(error).__name__:.200}"
