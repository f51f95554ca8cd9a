"""Columns of numbers, whatever file they stand in: what readers of tables give, and within which bounds."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from bags.mcap.errors import BagError

MOST_CELLS: Final = 12_000_000  # 96 MB of numbers; a file may hold as many cells as it has bytes


def most_cells(file: Path) -> int:
    """How many cells the columns of a file may have: what a small file holds more of is no measurement."""
    return max(MOST_CELLS, file.stat().st_size)


class ColumnKind(Enum):
    """What stands in a column."""

    NUMBER = "number"
    TIME = "time"  # instants as nanoseconds since 1970, or since midnight
    TEXT = "text"


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnInfo:
    """One column of a table.

    Attributes:
        name: As a mapping names it.
        kind: What stands in it, as far as its beginning tells.
        unit: As the file states it, "" when it does not.
    """

    name: str
    kind: ColumnKind
    unit: str = ""


class Table(Protocol):
    """A table opened for reading."""

    @property
    def file(self) -> Path:
        """The file."""

    @property
    def columns(self) -> Sequence[ColumnInfo]:
        """Its columns in order; two may have one name."""

    @property
    def rows(self) -> int:
        """How many rows; -1 when only reading would tell."""

    @property
    def notes(self) -> Sequence[str]:
        """What a person should know."""

    def parts(self, names: Sequence[str]) -> Iterator[Mapping[str, NDArray[np.float64] | NDArray[np.int64]]]:
        """Some columns, part by part: numbers with NaN where one is missing, or instants [ns].

        Raises:
            BagError: A cell holds something else, named by its row as an editor counts it.
        """

    def where(self, row: int) -> str:
        """How an editor calls a row, counted from 0 here."""


def read_columns(table: Table, names: Sequence[str]) -> dict[str, NDArray[np.float64] | NDArray[np.int64]]:
    """Some columns of a table as a whole: numbers, NaN where one is missing, or instants as integers [ns].

    Raises:
        BagError: A column is missing or stands there twice, holds something besides numbers, or is too long.
    """
    wanted = list(dict.fromkeys(names))
    check_names(table, wanted)
    limit = most_cells(table.file)
    parts: dict[str, list[NDArray[Any]]] = {name: [] for name in wanted}
    cells = 0
    for part in table.parts(wanted):
        cells += sum(len(one) for one in part.values())
        if cells > limit:
            raise BagError(f"{table.file}: holds more than {limit} cells in these columns, expected fewer: cut it up")
        for name, values in part.items():
            parts[name].append(values)
    found: dict[str, NDArray[np.float64] | NDArray[np.int64]] = {}
    for name, pieces in parts.items():
        kinds = {one.dtype.kind for one in pieces}
        if len(kinds) > 1:
            raise BagError(f"{table.file}: column {name} holds numbers and times, expected one of them")
        found[name] = np.concatenate(pieces) if pieces else np.empty(0)
        pieces.clear()
    return found


def check_names(table: Table, names: Sequence[str]) -> None:
    """Whether each name is that of exactly one column.

    Raises:
        BagError: It is not.
    """
    there = [one.name for one in table.columns]
    for name in names:
        if there.count(name) > 1:
            places = " and ".join(str(number) for number, one in enumerate(there, start=1) if one == name)
            raise BagError(
                f"{table.file}: {there.count(name)} columns are called {name!r} (columns {places}): rename one"
            )
        if name not in there:
            single = len(there) == 1 and len(there[0].split()) > 1
            hint = ": expected , ; | or a tab between columns" if single else ""
            raise BagError(f"{table.file}: has no column {name!r}, found {', '.join(map(repr, there)):.300}{hint}")


def library(name: str, extra: str, what: str) -> ModuleType:
    """Import a library that only some files need.

    Raises:
        BagError: It is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise BagError(f"{what} needs the Python package {name}, found none: pip install 'dcmg[{extra}]'") from error
