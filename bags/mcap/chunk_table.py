"""The chunk indexes of a file as arrays: an hour's recording has tens of thousands of them.

One object for each, as the `mcap` library keeps, would be hundreds of megabytes. Which channels a chunk holds is left
in the file and read when it is asked for.
"""

import struct
from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bags.mcap.file_bytes import FileBytes

_FIXED = struct.Struct("<QQQQI")  # times, start, length, bytes of the map from channels to message indexes
_REST = struct.Struct("<QI")  # length of the message indexes, letters of the compression
_SIZES = struct.Struct("<QQ")
_ENTRY = np.dtype([("channel_id", "<u2"), ("offset", "<i8")])


@dataclass(frozen=True, slots=True, kw_only=True)
class ChunkEntry:
    """What the summary says about one chunk.

    Attributes:
        start: Where the chunk starts in the file.
        length: Bytes of the chunk.
        index_length: Bytes of the message indexes behind it.
        compressed_size: Bytes of its data.
        compression: MCAP's name.
        start_ns: Earliest log time [ns].
        end_ns: Latest log time [ns].
        map_start: Where the map from channels to message indexes stands in the file.
        map_size: Its bytes.
    """

    start: int
    length: int
    index_length: int
    compressed_size: int
    compression: str
    start_ns: int
    end_ns: int
    map_start: int
    map_size: int

    def indexes(self, source: FileBytes) -> NDArray[np.void]:
        """Where the message index of each channel stands in the file: `channel_id`, `offset`, shape (channels,)."""
        return np.frombuffer(source.read(self.map_start, self.map_size), dtype=_ENTRY)


@dataclass(frozen=True, slots=True, kw_only=True)
class ChunkTable:
    """The chunks of a file in the order of the file.

    Attributes:
        numbers: Start, length, length of the indexes, compressed size, start and size of the map of each chunk, shape
            (chunks, 6).
        times_ns: Earliest and latest log time of each chunk, shape (chunks, 2) [ns].
        compressions: MCAP's name for each chunk.
    """

    numbers: NDArray[np.int64]
    times_ns: NDArray[np.uint64]
    compressions: tuple[str, ...]

    def __len__(self) -> int:
        """Number of chunks."""
        return len(self.numbers)

    @property
    def starts(self) -> list[int]:
        """Where the chunks start in the file."""
        return [int(start) for start in self.numbers[:, 0]]

    def at(self, start: int) -> ChunkEntry | None:
        """The chunk that starts at a position, if one does."""
        row = int(np.searchsorted(self.numbers[:, 0], start))
        return self._entry(row) if row < len(self) and self.numbers[row, 0] == start else None

    def entries(self, times_ns: tuple[int, int] | None = None) -> Iterator[ChunkEntry]:
        """The chunks in order, each made when it is asked for.

        Args:
            times_ns: Only chunks that reach into this range of log times, both ends included [ns]; None: all.
        """
        rows: NDArray[np.intp] = np.arange(len(self))
        if times_ns is not None:
            rows = np.flatnonzero((self.times_ns[:, 0] <= times_ns[1]) & (self.times_ns[:, 1] >= times_ns[0]))
        for row in rows.tolist():
            yield self._entry(row)

    def _entry(self, row: int) -> ChunkEntry:
        start, length, index_length, compressed_size, map_start, map_size = self.numbers[row].tolist()
        start_ns, end_ns = self.times_ns[row].tolist()
        return ChunkEntry(
            start=start,
            length=length,
            index_length=index_length,
            compressed_size=compressed_size,
            compression=self.compressions[row],
            start_ns=start_ns,
            end_ns=end_ns,
            map_start=map_start,
            map_size=map_size,
        )


def chunk_table(entries: Collection[ChunkEntry]) -> ChunkTable:
    """The table of the chunks that a summary lists in any order."""
    ordered = sorted(entries, key=lambda one: one.start)
    numbers = [
        (one.start, one.length, one.index_length, one.compressed_size, one.map_start, one.map_size) for one in ordered
    ]
    times_ns = [(one.start_ns, one.end_ns) for one in ordered]
    return ChunkTable(
        numbers=np.array(numbers, dtype=np.int64).reshape(-1, 6),
        times_ns=np.array(times_ns, dtype=np.uint64).reshape(-1, 2),
        compressions=tuple(one.compression for one in ordered),
    )


def read_entry(record: bytes, position: int) -> ChunkEntry | None:
    """What a chunk index record says, None when it is none.

    Args:
        record: Its content.
        position: Where the content stands in the file.
    """
    try:
        start_ns, end_ns, start, length, size = _FIXED.unpack_from(record)
        at = _FIXED.size + size
        index_length, letters = _REST.unpack_from(record, at)
        compression = record[at + _REST.size : at + _REST.size + letters].decode()
        compressed_size, _ = _SIZES.unpack_from(record, at + _REST.size + letters)
    except (struct.error, UnicodeDecodeError):
        return None
    fits = max(start, length, index_length, compressed_size) < 2**63
    if size % _ENTRY.itemsize or len(record) != at + _REST.size + letters + _SIZES.size or not fits:
        return None
    return ChunkEntry(
        start=start,
        length=length,
        index_length=index_length,
        compressed_size=compressed_size,
        compression={"": "", "lz4": "lz4", "zstd": "zstd"}.get(compression, compression),  # one object for all
        start_ns=start_ns,
        end_ns=end_ns,
        map_start=position + _FIXED.size,
        map_size=size,
    )
