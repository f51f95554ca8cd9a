"""The kept rows of finished cells: a file that is not what was written for its cell counts as none."""

import hashlib
import os
import re
from pathlib import Path

import pyarrow as pa
from pyarrow import parquet

_CELL, _SUM = b"cell", b"check_sum"
_BLANK = b"sha256:" + b"0" * 64
_STATED = re.compile(rb"sha256:[0-9a-f]{64}")


class Parts:
    """One Parquet file a cell, with the key of the cell and a check sum of the whole file among its metadata.

    Args:
        folder: Where they are kept; it is made.
        schema: Of their rows.

    Raises:
        OSError: The folder cannot be made.
    """

    def __init__(self, folder: Path, schema: pa.Schema) -> None:
        """Make the folder."""
        folder.mkdir(parents=True, exist_ok=True)
        self._folder, self._schema = folder, schema

    def path(self, key: str) -> Path:
        """Where the rows of a cell are kept."""
        return self._folder / f"{key}.parquet"

    def read(self, key: str) -> pa.Table | str | None:
        """The rows of a cell; None: there are none; a text: why what is there is not them."""
        path = self.path(key)
        if not os.path.lexists(path):
            return None
        if not path.is_file():
            return "is no file"
        try:
            data = path.read_bytes()
        except OSError as error:
            return f"cannot be read: {error.strerror}"
        stated = _STATED.findall(data)
        if len(stated) != 1 or hashlib.sha256(_STATED.sub(_BLANK, data)).hexdigest().encode() != stated[0][7:]:
            return "does not agree with its check sum"
        table = parquet.read_table(pa.BufferReader(data))
        if table.schema.metadata.get(_CELL) != key.encode():
            return "holds the rows of another cell"
        table = table.replace_schema_metadata(None)
        return table if table.schema == self._schema else "has other columns"

    def write(self, key: str, data: bytes) -> None:
        """Keep a part: as a whole or not at all; what is no file and stands in the way is set aside.

        Raises:
            OSError: It cannot be written.
        """
        path = self.path(key)
        if os.path.lexists(path) and not path.is_file():
            path.rename(path.with_name(f"{path.name}.set_aside_{os.getpid()}"))
        write_whole(data, path)


def as_part(key: str, table: pa.Table) -> bytes:
    """The file of a cell's rows."""
    target = pa.BufferOutputStream()
    told = table.schema.with_metadata({_CELL: key.encode(), _SUM: _BLANK})
    parquet.write_table(table.cast(told), target, compression="zstd")
    data: bytes = target.getvalue().to_pybytes()
    return data.replace(_BLANK, b"sha256:" + hashlib.sha256(data).hexdigest().encode())


def write_whole(data: bytes, path: Path) -> None:
    """Write a file that is there as a whole or not at all.

    Raises:
        OSError: It cannot be written.
    """
    half = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        half.write_bytes(data)
        half.replace(path)
    finally:
        half.unlink(missing_ok=True)
