"""Bags as files for other programs: CSV or Parquet, one file a topic; netCDF, one file a run."""

import re
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import final

from bags.mcap.bag import Bag, open_bag
from bags.mcap.errors import BagError
from bags.tables.rows import is_known
from bags.tables.tabular import library, tables, write_netcdf


class TableFormat(Enum):
    """Kind of the files."""

    CSV = "csv"
    PARQUET = "parquet"
    NETCDF = "netcdf"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ExportReport:
    """What was exported.

    Attributes:
        files: File of each exported topic, or of the run.
        left_out: Topics that hold no message, or messages of a type that we do not know.
    """

    files: dict[str, Path]
    left_out: tuple[str, ...]


def export(path: Path, out: Path, form: TableFormat) -> ExportReport:
    """Write every topic as a table: `time_ns`, then one column a number; or a run as one netCDF file.

    Columns carry the names of the message's fields, `header.stamp.sec`, elements of arrays as `x[0]`. Of messages that
    vary in length, sequences are lists in Parquet and JSON in CSV. Memory stays bounded by one block of messages.

    Args:
        path: The bag's directory.
        out: Folder for the files; must not exist, or be empty.
        form: CSV, Parquet or netCDF.

    Raises:
        BagError: The bag cannot be read, the folder holds something or cannot be written, or a package is missing.
    """
    bag = open_bag(path)
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise BagError(f"{out}: expected a new or empty folder, found one that holds something")
    try:
        out.mkdir(parents=True, exist_ok=True)
        if form is TableFormat.NETCDF:
            return ExportReport(files={"run": write_netcdf(path, out / "run.nc")}, left_out=())
        files: dict[str, Path] = {}
        for topic, info in bag.topics.items():
            if info.count and (bag.is_fixed(topic) or is_known(info.type_name)):
                files[topic] = out / f"{re.sub(r'[^A-Za-z0-9]+', '_', topic.strip('/'))}.{form.value}"
                _write(bag, topic, files[topic], form)
    except OSError as error:
        raise BagError(f"{out}: cannot write the tables ({error.strerror or error})") from error
    return ExportReport(files=files, left_out=tuple(topic for topic in bag.topics if topic not in files))


def _write(bag: Bag, topic: str, file: Path, form: TableFormat) -> None:
    parts = tables(bag, topic, text_lists=form is TableFormat.CSV)
    first = next(parts)
    if form is TableFormat.CSV:
        writer = library("pyarrow.csv").CSVWriter(str(file), first.schema)
    else:
        writer = library("pyarrow.parquet").ParquetWriter(str(file), first.schema)
    with writer:
        writer.write_table(first)
        for part in parts:
            writer.write_table(part.cast(first.schema))
