"""Closing a chunk: compressing it and making the bytes that go to the file, wherever that will be."""

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Protocol, cast

import lz4.frame  # type: ignore[import-untyped] # lz4 ships no types
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Chunk

from bags.mcap.chunk import OpenChunk

_ZSTD_LEVEL = 1  # 1.5 times as fast as the default 3, and no larger on our data


class Compression(Enum):
    """How the chunks of a bag are compressed; the values are MCAP's."""

    NONE = ""
    LZ4 = "lz4"
    ZSTD = "zstd"


class Record(Protocol):
    """A record of the `mcap` library."""

    def write(self, stream: RecordBuilder) -> None:
        """Write itself."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PackedChunk:
    """A closed chunk.

    Attributes:
        record: The chunk record.
        index_records: The message indexes that follow it.
        offsets: Where the index of each channel starts in `index_records`.
        counts: Messages by channel id.
        time_range_ns: Earliest and latest log time [ns].
        compression: MCAP's name.
        compressed_size: Bytes of the data.
        uncompressed_size: The same before compression.
    """

    record: bytes
    index_records: bytes
    offsets: Mapping[int, int]
    counts: Mapping[int, int]
    time_range_ns: tuple[int, int]
    compression: str
    compressed_size: int
    uncompressed_size: int

    @property
    def size(self) -> int:
        """Bytes that go to the file."""
        return len(self.record) + len(self.index_records)


def packer(compression: Compression) -> Callable[[OpenChunk], PackedChunk]:
    """What closes chunks with this compression; not for several threads at once."""
    compress = _compressor(compression)

    def pack(chunk: OpenChunk) -> PackedChunk:
        start_ns, end_ns = chunk.time_range_ns()
        data = compress(chunk.buffer)
        record = Chunk(
            compression=compression.value,
            data=data,
            message_start_time=start_ns,
            message_end_time=end_ns,
            uncompressed_crc=zlib.crc32(chunk.buffer),
            uncompressed_size=len(chunk.buffer),
        )
        offsets, counts, index_records = chunk.index_records()
        return PackedChunk(
            record=encode(record),
            index_records=index_records,
            offsets=offsets,
            counts=counts,
            time_range_ns=(start_ns, end_ns),
            compression=compression.value,
            compressed_size=len(data),
            uncompressed_size=len(chunk.buffer),
        )

    return pack


def encode(record: Record) -> bytes:
    """The bytes of a record."""
    builder = RecordBuilder()
    record.write(builder)
    return bytes(cast("bytes", builder.end()))  # type: ignore[no-untyped-call] # mcap leaves it without a type


def _compressor(compression: Compression) -> Callable[[bytearray], bytes]:
    match compression:
        case Compression.NONE:
            return bytes
        case Compression.LZ4:
            return cast("Callable[[bytearray], bytes]", lz4.frame.compress)
        case Compression.ZSTD:
            return zstandard.ZstdCompressor(level=_ZSTD_LEVEL).compress
