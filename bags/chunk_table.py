"""The chunk indexes of a file as arrays: an hour's recording has tens of thousands of them.

One object for each, as the `mcap` library keeps, would be hundreds of megabytes.
"""

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

_FIXED = struct.Struct("<QQQQI")  # times, start, length, bytes of the map from channels to message indexes
_REST = struct.Struct("<QI")  # length of the message indexes, letters of the compression
_SIZES = struct.Struct("<QQ")
_ENTRY = np.dtype([("channel_id", "<u2"), ("offset", "<i8")])


@final
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
        indexes: Where the message index of each channel stands in the file: `channel_id`, `offset`, shape (channels,).
    """

    start: int
    length: int
    index_length: int
    compressed_size: int
    compression: str
    start_ns: int
    end_ns: int
    indexes: NDArray[np.void]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ChunkTable:
    """The chunks of a file in the order of the file.

    Attributes:
        numbers: Start, length, length of the indexes and compressed size of each chunk, shape (chunks, 4).
        times_ns: Earliest and latest log time of each chunk, shape (chunks, 2) [ns].
        compressions: MCAP's name for each chunk.
        bounds: Where the entries of each chunk start in `indexes`, and where the last ones end, shape (chunks + 1,).
        indexes: The message indexes of all chunks, shape (entries,).
    """

    numbers: NDArray[np.int64]
    times_ns: NDArray[np.uint64]
    compressions: tuple[str, ...]
    bounds: NDArray[np.int64]
    indexes: NDArray[np.void]

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

    def entries(
        self, channel_ids: Sequence[int] | None = None, times_ns: tuple[int, int] | None = None
    ) -> Iterator[ChunkEntry]:
        """The chunks in order, each made when it is asked for.

        Args:
            channel_ids: Only chunks that hold messages of these channels, or do not say; None: all.
            times_ns: Only chunks that reach into this range of log times, both ends included [ns]; None: all.
        """
        rows: NDArray[np.intp] = np.arange(len(self))
        if times_ns is not None:
            rows = np.flatnonzero((self.times_ns[:, 0] <= times_ns[1]) & (self.times_ns[:, 1] >= times_ns[0]))
        wanted = None if channel_ids is None else set(channel_ids)
        for row in rows.tolist():
            entry = self._entry(row)
            if wanted is None or not entry.index_length or not wanted.isdisjoint(entry.indexes["channel_id"].tolist()):
                yield entry

    def _entry(self, row: int) -> ChunkEntry:
        start, length, index_length, compressed_size = self.numbers[row].tolist()
        start_ns, end_ns = self.times_ns[row].tolist()
        return ChunkEntry(
            start=start,
            length=length,
            index_length=index_length,
            compressed_size=compressed_size,
            compression=self.compressions[row],
            start_ns=start_ns,
            end_ns=end_ns,
            indexes=self.indexes[self.bounds[row] : self.bounds[row + 1]],
        )


def chunk_table(records: Sequence[bytes]) -> ChunkTable | None:
    """The table of the chunk index records of a summary, None when one of them is none.

    Args:
        records: Their contents, in any order.
    """
    numbers = np.empty((len(records), 4), dtype=np.int64)
    times_ns = np.empty((len(records), 2), dtype=np.uint64)
    compressions: list[str] = []
    indexes: list[NDArray[np.void]] = []
    known: dict[bytes, str] = {}
    for row, record in enumerate(records):
        try:
            first_ns, last_ns, start, length, size = _FIXED.unpack_from(record)
            at = _FIXED.size + size
            index_length, letters = _REST.unpack_from(record, at)
            name = record[at + _REST.size : at + _REST.size + letters]
            compressed_size, _ = _SIZES.unpack_from(record, at + _REST.size + letters)
            compression = known.setdefault(name, name.decode())
        except (struct.error, UnicodeDecodeError):
            return None
        numbers_fit = max(start, length, index_length, compressed_size) < 2**63
        if size % _ENTRY.itemsize or len(record) != at + _REST.size + letters + _SIZES.size or not numbers_fit:
            return None
        numbers[row] = start, length, index_length, compressed_size
        times_ns[row] = first_ns, last_ns
        compressions.append(compression)
        indexes.append(np.frombuffer(record, dtype=_ENTRY, count=size // _ENTRY.itemsize, offset=_FIXED.size))
    order = np.argsort(numbers[:, 0], kind="stable").tolist()
    indexes = [indexes[row] for row in order]
    return ChunkTable(
        numbers=numbers[order],
        times_ns=times_ns[order],
        compressions=tuple(compressions[row] for row in order),
        bounds=np.cumsum([0, *(len(one) for one in indexes)]),
        indexes=np.concatenate(indexes) if indexes else np.empty(0, dtype=_ENTRY),
    )
