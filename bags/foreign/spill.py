"""Rows of numbers that need not be in memory: an hour of twenty topics is hundreds of megabytes."""

from array import array
from collections.abc import Sequence
from tempfile import TemporaryFile
from typing import IO, Protocol

import numpy as np
from numpy.typing import NDArray

_KEPT = 1 << 16  # numbers in memory
_BYTES = 8


class Rows(Protocol):
    """Rows of numbers, shape (rows, columns)."""

    def __len__(self) -> int:
        """Number of rows."""

    def __getitem__(self, indices: NDArray[np.intp]) -> NDArray[np.float64]:
        """Some rows."""


class SpilledRows:
    """Rows that are appended one by one and read in any order, near ones together; on disk once they are many."""

    def __init__(self, columns: int) -> None:
        """Start without rows."""
        self._columns = columns
        self._tail = array("d")
        self._file: IO[bytes] | None = None
        self._stored = 0  # numbers in the file

    def append(self, row: Sequence[float]) -> None:
        """Add one row."""
        self._tail.extend(row)
        if len(self._tail) >= _KEPT:
            self._file = self._file or TemporaryFile(prefix="dcmg_")  # noqa: SIM115 - it lives as long as this object
            self._file.seek(0, 2)
            self._tail.tofile(self._file)
            self._stored += len(self._tail)
            self._tail = array("d")

    def __len__(self) -> int:
        """Number of rows."""
        return (self._stored + len(self._tail)) // self._columns

    def __getitem__(self, indices: NDArray[np.intp]) -> NDArray[np.float64]:
        """Some rows, shape (indices, columns); what lies between near ones is read with them."""
        found = np.empty((len(indices), self._columns))
        order = np.argsort(indices, kind="stable")
        ordered, most = indices[order], max(_KEPT // self._columns, 1)
        start = 0
        while start < len(ordered):
            first = int(ordered[start])
            stop = int(np.searchsorted(ordered, first + most))
            last = int(ordered[stop - 1]) + 1
            rows = self._span(first * self._columns, last * self._columns).reshape(-1, self._columns)
            found[order[start:stop]] = rows[ordered[start:stop] - first]
            start = stop
        return found

    def _span(self, start: int, end: int) -> NDArray[np.float64]:
        parts = []
        if self._file is not None and start < self._stored:
            self._file.seek(start * _BYTES)
            parts.append(np.frombuffer(self._file.read((min(end, self._stored) - start) * _BYTES), dtype=np.float64))
        if end > self._stored:
            kept = slice(max(start - self._stored, 0), end - self._stored)
            parts.append(np.array(self._tail[kept], dtype=np.float64))
        return np.concatenate(parts)
