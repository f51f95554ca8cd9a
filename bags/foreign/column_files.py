"""Tables that are no text: Parquet, HDF5 and netCDF, MAT, spreadsheets; each read by a well-kept library."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bags.foreign.cells import is_missing, is_number, is_time, times_of
from bags.foreign.columns import ColumnInfo, ColumnKind, library, most_cells
from bags.foreign.mat_arrays import mat_arrays
from bags.foreign.units import unit_in_name
from bags.mcap.errors import BagError
from bags.mcap.kinds import check_regular

_ROWS = 65_536
_MOST_ROWS = 1 << 20  # of a spreadsheet
_MOST_SHEET_CELLS = 2_500_000  # each is an object
_TEXTS = ("string", "large_string", "binary", "dictionary", "list", "large_list", "fixed_size_list", "struct", "map")
_MATRIX = 2  # dimensions
_MOST_COLUMNS = 1000  # of a matrix


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrayTable:
    """Columns that a library gives as arrays.

    Attributes:
        file: The file.
        columns: Its columns.
        rows: How many rows; -1 when columns differ in length.
        notes: What a person should know.
        first_row: What an editor calls the first row of values.
    """

    file: Path
    columns: tuple[ColumnInfo, ...]
    rows: int
    notes: tuple[str, ...] = ()
    first_row: int = 1
    _read: Callable[[Sequence[str]], Iterator[Mapping[str, NDArray[Any]]]] = field(repr=False)

    def parts(self, names: Sequence[str]) -> Iterator[Mapping[str, NDArray[np.float64] | NDArray[np.int64]]]:
        """Some columns, part by part.

        Raises:
            BagError: They differ in length, or hold something besides numbers.
        """
        row = 0
        with _readable(self.file):
            for part in self._read(names):
                lengths = {name: len(values) for name, values in part.items()}
                if len(set(lengths.values())) > 1:
                    told = ", ".join(f"{name} {length}" for name, length in lengths.items())
                    raise BagError(f"columns differ in length ({told}), expected one length")
                yield {name: self._numbers(name, values, row) for name, values in part.items()}
                row += next(iter(lengths.values()), 0)

    def where(self, row: int) -> str:
        """A row, counted from 1, or as the spreadsheet counts it."""
        return f"row {row + self.first_row}"

    def _numbers(self, name: str, values: NDArray[Any], row: int) -> NDArray[np.float64] | NDArray[np.int64]:
        kind = values.dtype.kind
        if kind in "mM":
            missing = np.flatnonzero(np.isnat(values))
            if len(missing):
                raise BagError(f"column {name} holds no time in {self.where(row + int(missing[0]))}")
            return values.astype("datetime64[ns]" if kind == "M" else "timedelta64[ns]").astype(np.int64)
        if kind in "biuf":
            found = values.astype(np.float64)
            return np.where(np.isinf(found), np.nan, found)
        cells = values.tolist()
        if cells and isinstance(cells[0], str) and is_time(cells[0]):
            return self._times(name, cells, row)
        found = np.full(len(values), np.nan)
        for position, cell in enumerate(cells):
            if cell is None or (isinstance(cell, str) and is_missing(cell)):
                continue
            text = str(cell)
            if not is_number(text, "."):
                raise BagError(
                    f"column {name} holds {text!r:.40} in {self.where(row + position)}, expected a number, or an empty "
                    "cell for a missing one"
                )
            found[position] = float({"true": "1", "false": "0"}.get(text.strip().lower(), text))
        return np.where(np.isinf(found), np.nan, found)

    def _times(self, name: str, cells: Sequence[Any], row: int) -> NDArray[np.int64]:
        """Instants that are written as text."""
        texts = ["" if cell is None else str(cell) for cell in cells]
        instants, wrong = times_of(texts)
        if wrong is not None:
            raise BagError(f"column {name} holds {texts[wrong]!r:.40} in {self.where(row + wrong)}, expected a time")
        return instants


def open_parquet(file: Path) -> ArrayTable:
    """Open a Parquet file, read row group by row group.

    Raises:
        BagError: It is none.
    """
    with _opened(file, "Parquet"):
        parquet = library("pyarrow.parquet", "tables", "Parquet")
        opened = parquet.ParquetFile(file)
        schema, rows = opened.schema_arrow, opened.metadata.num_rows

    def read(names: Sequence[str]) -> Iterator[Mapping[str, NDArray[Any]]]:
        _check_cells(rows * len(names), file)
        for batch in opened.iter_batches(batch_size=_ROWS, columns=list(names)):
            yield {name: _arrow_values(batch.column(name)) for name in names}

    columns = tuple(ColumnInfo(name=str(one.name), kind=_arrow_kind(one.type)) for one in schema)
    return ArrayTable(file=file, columns=columns, rows=rows, _read=read)


def open_hdf5(file: Path) -> ArrayTable:
    """Open an HDF5 or netCDF-4 file, or a MAT file of version 7.3: each of its arrays is a column, or several.

    Raises:
        BagError: It is none, or h5py is not installed.
    """
    h5py = library("h5py", "tables", "HDF5")
    found: list[tuple[ColumnInfo, str, int | str | None]] = []
    left_out: list[str] = []
    matlab = file.suffix.lower() == ".mat"

    def visit(name: str, node: Any) -> None:  # noqa: ANN401 - h5py ships no types
        if not isinstance(node, h5py.Dataset) or name.startswith("#refs#"):
            return
        if node.dtype.names and len(node.shape) == 1:  # rows of several numbers: a column each
            for part in node.dtype.names:
                whole = f"{name}.{part}"
                left_out.extend(_no_columns(whole, node.dtype[part].kind, node.shape))
                if node.dtype[part].kind in "biuf":
                    found.append((ColumnInfo(name=whole, kind=ColumnKind.NUMBER, unit=unit_in_name(part)), name, part))
            return
        left_out.extend(_no_columns(name, node.dtype.kind, node.shape))
        if node.dtype.kind not in "biuf":
            return
        unit = _text(node.attrs.get("units", node.attrs.get("unit", "")))
        # MATLAB stores the transpose: what it calls a column of n numbers is 1 x n here
        shape = node.shape[::-1] if matlab else node.shape
        found.extend((info, name, place) for info, place in _columns_of(name, shape, unit))

    with _opened(file, "HDF5"), h5py.File(file, "r") as opened:
        opened.visititems(visit)

    def read(names: Sequence[str]) -> Iterator[Mapping[str, NDArray[Any]]]:
        with h5py.File(file, "r") as opened:
            places = {info.name: (where, place) for info, where, place in found}
            _check_cells(sum(max(opened[places[name][0]].shape, default=0) for name in names), file)
            part = {}
            for name in names:
                where, place = places[name]
                node = opened[where]
                if place is None:
                    part[name] = node[()].ravel()
                else:
                    part[name] = node[place] if isinstance(place, str) else node[place, :] if matlab else node[:, place]
            yield part

    return _arrays(file, [info for info, _, _ in found], read, left_out)


def open_netcdf3(file: Path) -> ArrayTable:
    """Open a netCDF file of version 3.

    Raises:
        BagError: It is none.
    """
    from scipy.io import netcdf_file  # noqa: PLC0415 - heavy

    with _opened(file, "netCDF"), netcdf_file(str(file), "r", mmap=False) as opened:
        units = {name: _text(getattr(one, "units", "")) for name, one in opened.variables.items()}
        arrays = {name: np.array(one.data) for name, one in opened.variables.items()}
    return _of_arrays(file, arrays, units)


def open_mat(file: Path) -> ArrayTable:
    """Open a MAT file.

    Raises:
        BagError: It is none; version 7.3 needs h5py.
    """
    with file.open("rb") as stream:
        if b"MATLAB 7.3" in stream.read(128):
            return open_hdf5(file)
    check_regular(file)
    return _of_arrays(file, mat_arrays(file), {})


def open_spreadsheet(file: Path) -> ArrayTable:
    """Open the first sheet of a spreadsheet: names in its first row.

    Raises:
        BagError: It is none, or openpyxl is not installed.
    """
    openpyxl = library("openpyxl", "tables", ".xlsx")
    with _opened(file, "spreadsheet"):
        book = openpyxl.load_workbook(file, read_only=True, data_only=True)
        sheet = book.worksheets[0]
        rows: list[tuple[Any, ...]] = []
        for number, row in enumerate(sheet.iter_rows(values_only=True)):
            if number > _MOST_ROWS or number * len(row) > _MOST_SHEET_CELLS:
                raise BagError(f"{file}: holds more than {number} rows, expected fewer: save it as CSV")
            rows.append(row)
        others = [one.title for one in book.worksheets[1:]]
        book.close()
    while rows and all(cell is None for cell in rows[-1]):
        rows.pop()
    if not rows:
        raise BagError(f"{file}: the first sheet is empty, expected names in its first row")
    names = [str(cell).strip() if cell is not None else "" for cell in rows[0]]
    units, body = [""] * len(names), rows[1:]
    if (
        len(body) > 1
        and all(isinstance(cell, str) for cell in body[0] if cell is not None)
        and not all(isinstance(cell, str) for cell in body[1] if cell is not None)
    ):
        units, body = [str(cell or "").strip("[]() ") for cell in body[0]], body[1:]

    def read(wanted: Sequence[str]) -> Iterator[Mapping[str, NDArray[Any]]]:
        yield {name: _sheet_values([row[names.index(name)] for row in body]) for name in wanted}

    columns = tuple(
        ColumnInfo(name=name, kind=_sheet_kind([row[at] for row in body[:50]]), unit=units[at] or unit_in_name(name))
        for at, name in enumerate(names)
    )
    notes = (f"{file.name}: the sheet {sheet.title} was read, {', '.join(others):.100} not",) if others else ()
    first = 1 + len(rows) - len(body)
    return ArrayTable(file=file, columns=columns, rows=len(body), notes=notes, first_row=first, _read=read)


def _of_arrays(file: Path, arrays: Mapping[str, NDArray[Any]], units: Mapping[str, str]) -> ArrayTable:
    found: dict[str, tuple[ColumnInfo, NDArray[Any], int | None]] = {}
    left_out: list[str] = []
    for name, values in arrays.items():
        left_out.extend(_no_columns(name, values.dtype.kind, values.shape))
        if values.dtype.kind in "biuf":
            for info, place in _columns_of(name, values.shape, units.get(name, "")):
                found[info.name] = info, values, place

    def read(names: Sequence[str]) -> Iterator[Mapping[str, NDArray[Any]]]:
        taken = {name: found[name] for name in names}
        yield {name: values.ravel() if at is None else values[:, at] for name, (_, values, at) in taken.items()}

    return _arrays(file, [info for info, _, _ in found.values()], read, left_out)


def _arrays(
    file: Path,
    columns: Sequence[ColumnInfo],
    read: Callable[[Sequence[str]], Iterator[Mapping[str, NDArray[Any]]]],
    left_out: Sequence[str],
) -> ArrayTable:
    told = f": {', '.join(left_out):.300}" if left_out else ""
    if not columns:
        raise BagError(f"{file}: holds no array of numbers, expected some{told}")
    notes = (f"{file.name}: left out{told}",) if left_out else ()
    return ArrayTable(file=file, columns=tuple(columns), rows=-1, notes=notes, _read=read)


def _no_columns(name: str, kind: str, shape: Sequence[int]) -> Iterator[str]:
    """What an array is that is neither columns nor a single number."""
    if kind not in "biuf":
        yield f"{name} (no numbers)"
    elif len(shape) > _MATRIX:
        yield f"{name} ({len(shape)} dimensions)"
    elif len(shape) == _MATRIX and 1 not in shape and shape[1] > _MOST_COLUMNS:
        yield f"{name} ({shape[1]} columns)"


def _columns_of(name: str, shape: Sequence[int], unit: str) -> Iterator[tuple[ColumnInfo, int | None]]:
    """Columns of an array: one when it is a vector, one a column when it is a matrix; none when it is more."""
    if len(shape) == 1 or (len(shape) == _MATRIX and 1 in shape):
        if max(shape) > 1:  # a single number is a parameter, no column
            yield ColumnInfo(name=name, kind=ColumnKind.NUMBER, unit=unit), None
    elif len(shape) == _MATRIX:
        for place in range(shape[1] if shape[1] <= _MOST_COLUMNS else 0):
            yield ColumnInfo(name=f"{name}[{place}]", kind=ColumnKind.NUMBER, unit=unit), place


def _arrow_values(column: Any) -> NDArray[Any]:  # noqa: ANN401 - pyarrow ships no types
    import pyarrow as pa  # noqa: PLC0415 - beside its user

    kind = column.type
    if pa.types.is_timestamp(kind) or pa.types.is_date(kind):
        return np.asarray(
            column.cast(pa.timestamp("ns", tz=getattr(kind, "tz", None))).to_numpy(zero_copy_only=False)
        ).astype("datetime64[ns]")
    if pa.types.is_time(kind) or pa.types.is_duration(kind):
        spans = column.cast(pa.time64("ns") if pa.types.is_time(kind) else pa.duration("ns")).cast(pa.int64())
        return np.asarray(spans.to_numpy(zero_copy_only=False)).astype("timedelta64[ns]")
    if pa.types.is_dictionary(kind):
        return _arrow_values(column.dictionary_decode())
    if pa.types.is_null(kind):
        return np.full(len(column), np.nan)
    if pa.types.is_decimal(kind):
        column = column.cast(pa.string())  # on the way through a text the nearest number comes out
    if (
        pa.types.is_integer(kind)
        or pa.types.is_floating(kind)
        or pa.types.is_boolean(kind)
        or pa.types.is_decimal(kind)
    ):
        return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False))
    return np.array(column.to_pylist(), dtype=object)


def _arrow_kind(kind: Any) -> ColumnKind:  # noqa: ANN401 - idem
    text = str(kind)
    if text.startswith(("timestamp", "date", "time", "duration")):
        return ColumnKind.TIME
    return ColumnKind.TEXT if text.startswith(_TEXTS) else ColumnKind.NUMBER


def _sheet_kind(cells: Sequence[Any]) -> ColumnKind:
    there = [cell for cell in cells if cell is not None]
    if there and all(hasattr(cell, "isoformat") for cell in there):
        return ColumnKind.TIME
    if there and all(isinstance(cell, str) and is_time(cell) for cell in there):
        return ColumnKind.TIME
    texts = [cell for cell in there if isinstance(cell, str) and not is_missing(cell) and not is_number(cell, ".")]
    return ColumnKind.TEXT if there and len(texts) > len(there) / 2 else ColumnKind.NUMBER


def _sheet_values(cells: Sequence[Any]) -> NDArray[Any]:
    there = [cell for cell in cells if cell is not None]
    if there and all(hasattr(cell, "year") for cell in there):
        return np.array(cells, dtype="datetime64[us]")
    if there and all(hasattr(cell, "isoformat") for cell in there):
        seconds = [
            np.nan if one is None else one.hour * 3600 + one.minute * 60 + one.second + one.microsecond * 1e-6
            for one in cells
        ]
        return np.round(np.array(seconds) * 1e9).astype("timedelta64[ns]")
    return np.array(cells, dtype=object)


def _text(value: Any) -> str:  # noqa: ANN401 - whatever an attribute holds
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def _check_cells(cells: int, file: Path) -> None:
    if cells > (most := most_cells(file)):
        raise BagError(f"holds {cells} cells in these columns, expected at most {most}: cut it up")


@contextmanager
def _opened(file: Path, what: str) -> Iterator[None]:
    check_regular(file)
    try:
        yield
    except BagError:
        raise
    except Exception as error:  # each library has its own kinds
        reason = " ".join(str(error).split()) or type(error).__name__
        raise BagError(f"{file}: cannot be read as {what} ({reason:.200})") from error


@contextmanager
def _readable(file: Path) -> Iterator[None]:
    try:
        yield
    except BagError as error:
        text = str(error)
        raise BagError(text if text.startswith(str(file)) else f"{file}: {text}") from None
    except Exception as error:  # each library has its own kinds
        reason = " ".join(str(error).split()) or type(error).__name__
        raise BagError(f"{file}: damaged ({reason:.200})") from error
