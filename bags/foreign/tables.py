"""CSV and Parquet files as columns of numbers."""

import csv
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bags.mcap.errors import BagError

_SUFFIXES = (".csv", ".parquet")


def is_table(source: Path) -> bool:
    """Whether the name of a file says that it is a table."""
    return source.suffix.lower() in _SUFFIXES


def read_columns(file: Path, names: Sequence[str]) -> dict[str, NDArray[np.float64]]:
    """Some columns of a table; an empty cell, null or NaN is a missing value.

    Args:
        file: `*.csv` with names in the first row, or `*.parquet`.
        names: The columns.

    Raises:
        BagError: The file cannot be read, a column is missing, or holds something besides numbers.
    """
    columns = all_columns(file)
    found: dict[str, NDArray[np.float64]] = {}
    for name in names:
        if name not in columns:
            raise BagError(f"{file}: has no column {name!r}, found {', '.join(columns):.300}")
        try:
            found[name] = np.array([_number(cell) for cell in columns[name]], dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise BagError(f"{file}: column {name} holds something besides numbers ({error})") from error
        if np.isinf(found[name]).any():
            row = int(np.flatnonzero(np.isinf(found[name]))[0])
            raise BagError(f"{file}: column {name} holds {found[name][row]} in row {row}, expected a number")
    return found


def all_columns(file: Path) -> dict[str, Sequence[object]]:
    """Every column of a table by name, as it stands there.

    Raises:
        BagError: The file cannot be read.
    """
    try:
        return _parquet(file) if file.suffix.lower() == ".parquet" else _csv(file)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise BagError(f"{file}: cannot be read ({error})") from error


def _number(cell: object) -> float:
    if cell is None or cell == "":
        return float("nan")
    if isinstance(cell, str):
        truth = {"true": 1.0, "false": 0.0}.get(cell.strip().lower())
        return float(cell) if truth is None else truth
    return float(cell)  # type: ignore[arg-type]  # whatever Parquet holds: float() raises for what is no number


def _csv(file: Path) -> dict[str, Sequence[object]]:
    with file.open(newline="", encoding="utf-8-sig") as stream:
        rows = [row for row in csv.reader(stream) if row]
    head = [name.strip() for name in rows[0]] if rows else []
    for number, row in enumerate(rows[1:]):
        if len(row) != len(head):
            raise BagError(f"{file}: row {number} has {len(row)} cells, expected {len(head)}")
    return {name: [row[position] for row in rows[1:]] for position, name in enumerate(head)}


def _parquet(file: Path) -> dict[str, Sequence[object]]:
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
