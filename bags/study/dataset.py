"""The table of a study: a Parquet data set of as many files as cells, which may be larger than memory."""

import os
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import quote

import pyarrow as pa
from pyarrow import parquet

from bags.study.cells import StudyCell
from bags.study.errors import StudyError
from bags.study.parts import Parts

TABLE = "table"


def lay_out(cells: Sequence[StudyCell], parts: Parts, out: Path) -> Path:
    """Make the data set of exactly these cells: `table/CONDITION/OBSERVER/seeds_FIRST_LAST.parquet`, in their order.

    Its files are those of the parts, under other names: they take no further space where links are possible.

    Returns:
        Its folder, which any Parquet reader takes as one table.

    Raises:
        StudyError: A file is in its place.
        OSError: It cannot be written.
    """
    folder, half, old = out / TABLE, out / f".{TABLE}.{os.getpid()}", out / f".{TABLE}.{os.getpid()}.old"
    if os.path.lexists(folder) and not folder.is_dir():
        raise StudyError(f"{folder}: is no folder, expected the place of a folder to be written")
    for left in out.glob(f".{TABLE}.*"):  # of a process that was killed here
        shutil.rmtree(left)
    for cell, path in zip(cells, _places(cells), strict=True):
        (half / path.parent).mkdir(parents=True, exist_ok=True)
        _link(parts.path(cell.key), half / path)
    if folder.exists():
        folder.rename(old)
    half.rename(folder)
    shutil.rmtree(old, ignore_errors=True)
    return folder


def tables_of(folder: Path) -> Iterator[pa.Table]:
    """Yield the rows of a study's data set, a cell at a time, in the order of the cells."""
    for path in sorted(folder.glob("*/*/*.parquet")):
        yield parquet.ParquetFile(path).read()


def _places(cells: Sequence[StudyCell]) -> Iterator[Path]:
    """Numbers before the names, so that whoever sorts paths has the order of the study."""
    conditions = list(dict.fromkeys(cell.condition for cell in cells))
    observers = list(dict.fromkeys(cell.observer.name for cell in cells))
    for cell in cells:
        first, last = cell.seeds[0], cell.seeds[-1]
        condition = _folder(conditions.index(cell.condition), cell.condition)
        observer = _folder(observers.index(cell.observer.name), cell.observer.name)
        yield Path(condition, observer, f"seeds_{first:09d}_{last:09d}.parquet")


def _folder(number: int, name: str) -> str:
    return f"{number:03d}_{quote(name, safe=' ')}"


def _link(source: Path, target: Path) -> None:
    try:
        os.link(source, target)
    except OSError:  # no links on this file system
        shutil.copyfile(source, target)
