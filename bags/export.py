"""Topics of a bag as tables for other programs: CSV or Parquet, one file a topic."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from bags.bag import Bag, TopicBlock, open_bag
from bags.errors import BagError


class TableFormat(Enum):
    """Kind of the files."""

    CSV = "csv"
    PARQUET = "parquet"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ExportReport:
    """What was exported.

    Attributes:
        files: File of each exported topic.
        left_out: Topics whose messages vary in length or that hold none.
    """

    files: dict[str, Path]
    left_out: tuple[str, ...]


def export(path: Path, out: Path, form: TableFormat) -> ExportReport:
    """Write every topic of fixed length as a table: `time_ns`, then one column a number.

    Columns carry the names of the message's fields, `header.stamp.sec`, elements of arrays as `x[0]`. Memory stays
    bounded by one block of messages.

    Args:
        path: The bag's directory.
        out: Folder for the files; must not exist, or be empty.
        form: CSV or Parquet.

    Raises:
        BagError: The bag cannot be read, the folder holds something or cannot be written, or pyarrow is not installed.
    """
    arrow = _arrow()
    bag = open_bag(path)
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise BagError(f"{out}: expected a new or empty folder, found one that holds something")
    files: dict[str, Path] = {}
    try:
        out.mkdir(parents=True, exist_ok=True)
        for topic, info in bag.topics.items():
            if info.count and bag.is_fixed(topic):
                files[topic] = out / f"{re.sub(r'[^A-Za-z0-9]+', '_', topic.strip('/'))}.{form.value}"
                _write(arrow, bag, topic, files[topic], form)
    except OSError as error:
        raise BagError(f"{out}: cannot write the tables ({error.strerror or error})") from error
    return ExportReport(files=files, left_out=tuple(topic for topic in bag.topics if topic not in files))


def columns(block: TopicBlock) -> dict[str, NDArray[Any]]:
    """The numbers of a block as columns of shape (messages,), by name."""
    found: dict[str, NDArray[Any]] = {"time_ns": block.time_ns}
    for name in block.data.dtype.names or ():
        values = block.data[name]
        if values.dtype.kind in "SV":  # the string and the encapsulation are the same in every message
            continue
        if name.endswith(".length") and name.removesuffix(".length") in (block.data.dtype.names or ()):
            continue
        if values.ndim == 1:
            found[name] = values
        else:
            found |= {f"{name}[{position}]": values[:, position] for position in range(values.shape[1])}
    return found


def _write(arrow: ModuleType, bag: Bag, topic: str, file: Path, form: TableFormat) -> None:
    tables = _tables(arrow, bag, topic)
    first = next(tables)
    if form is TableFormat.CSV:
        writer = arrow.csv.CSVWriter(str(file), first.schema)
    else:
        writer = arrow.parquet.ParquetWriter(str(file), first.schema)
    with writer:
        writer.write_table(first)
        for table in tables:
            writer.write_table(table)


def _tables(arrow: ModuleType, bag: Bag, topic: str) -> Iterator[Any]:
    for block in bag.blocks(topic):
        yield arrow.table({name: np.ascontiguousarray(values) for name, values in columns(block).items()})


def _arrow() -> ModuleType:
    try:
        for part in ("pyarrow.csv", "pyarrow.parquet"):
            import_module(part)
        return import_module("pyarrow")
    except ImportError as error:
        raise BagError("export needs the Python package pyarrow, found none: pip install pyarrow") from error
