"""An MCAP file being written: records of the `mcap` library around message chunks that we fill ourselves.

The library's own writer takes one message at a time. This one also takes the bytes of many messages at once, because
the offline simulation writes hundreds of thousands of messages a second. Chunks go to the operating system as soon
as they are closed, so what a killed process loses is the open chunk.
"""

import struct
import zlib
from collections.abc import Callable, Mapping
from enum import Enum
from pathlib import Path
from typing import Protocol, cast, final

import lz4.frame  # type: ignore[import-untyped] # lz4 ships no types
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import LIBRARY_IDENTIFIER, MCAP0_MAGIC

from bags.chunk import OpenChunk

_ZSTD_LEVEL = 1  # 1.5 times as fast as the default 3, and no larger on our data


class Compression(Enum):
    """How the chunks of a bag are compressed; the values are MCAP's."""

    NONE = ""
    LZ4 = "lz4"
    ZSTD = "zstd"


class _Record(Protocol):
    def write(self, stream: RecordBuilder) -> None: ...


@final
class McapFile:
    """Writes the records of one MCAP file in order; `finish` makes it complete."""

    def __init__(self, path: Path, compression: Compression, profile: str) -> None:
        """Create the file.

        Args:
            path: Must not exist.
            compression: Of the chunks.
            profile: MCAP profile.

        Raises:
            OSError: The file exists or cannot be created.
        """
        self._stream = path.open("xb")
        self._compression = compression
        self._compress = _compressor(compression)
        self._definitions: dict[Opcode, list[bytes]] = {Opcode.SCHEMA: [], Opcode.CHANNEL: []}
        self._indexes: dict[Opcode, list[bytes]] = {
            Opcode.CHUNK_INDEX: [],
            Opcode.ATTACHMENT_INDEX: [],
            Opcode.METADATA_INDEX: [],
        }
        self._counts: dict[int, int] = {}  # messages by channel id
        self._start_ns, self._end_ns = 2**64 - 1, 0
        self._stream.write(MCAP0_MAGIC)
        self._append(Header(profile=profile, library=LIBRARY_IDENTIFIER))

    @property
    def time_range_ns(self) -> tuple[int, int]:
        """Earliest and latest log time [ns]; (0, 0) without messages."""
        return (self._start_ns, self._end_ns) if self._indexes[Opcode.CHUNK_INDEX] else (0, 0)

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Append a schema and return its id."""
        known = self._definitions[Opcode.SCHEMA]
        record = _encode(Schema(id=len(known) + 1, name=name, encoding=encoding, data=data))
        known.append(record)
        self._stream.write(record)
        return len(known)

    def add_channel(self, topic: str, encoding: str, schema_id: int, metadata: Mapping[str, str]) -> int:
        """Append a channel and return its id."""
        known = self._definitions[Opcode.CHANNEL]
        channel = Channel(
            id=len(known) + 1,
            topic=topic,
            message_encoding=encoding,
            schema_id=schema_id,
            metadata=dict(metadata),
        )
        record = _encode(channel)
        known.append(record)
        self._stream.write(record)
        self._counts[channel.id] = 0
        return channel.id

    def add_attachment(self, name: str, media_type: str, data: bytes) -> None:
        """Append an attachment; its times are 0, so that equal runs give equal files."""
        attachment = Attachment(create_time=0, log_time=0, name=name, media_type=media_type, data=data)
        offset, length = self._append(attachment)
        index = AttachmentIndex(
            offset=offset,
            length=length,
            create_time=0,
            log_time=0,
            data_size=len(data),
            name=name,
            media_type=media_type,
        )
        self._indexes[Opcode.ATTACHMENT_INDEX].append(_encode(index))

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Append a metadata record."""
        offset, length = self._append(Metadata(name=name, metadata=dict(values)))
        self._indexes[Opcode.METADATA_INDEX].append(_encode(MetadataIndex(offset=offset, length=length, name=name)))

    def add_chunk(self, chunk: OpenChunk) -> None:
        """Close a chunk: compress it, write it with its message indexes and hand all to the operating system."""
        start_ns, end_ns = chunk.time_range_ns()
        data = self._compress(chunk.buffer)
        offset, length = self._append(
            Chunk(
                compression=self._compression.value,
                data=data,
                message_start_time=start_ns,
                message_end_time=end_ns,
                uncompressed_crc=zlib.crc32(chunk.buffer),
                uncompressed_size=len(chunk.buffer),
            )
        )
        offsets, counts, index_records = chunk.index_records(offset + length)
        self._stream.write(index_records)
        self.flush()
        index = ChunkIndex(
            message_start_time=start_ns,
            message_end_time=end_ns,
            chunk_start_offset=offset,
            chunk_length=length,
            message_index_offsets=offsets,
            message_index_length=len(index_records),
            compression=self._compression.value,
            compressed_size=len(data),
            uncompressed_size=len(chunk.buffer),
        )
        self._indexes[Opcode.CHUNK_INDEX].append(_encode(index))
        for channel_id, count in counts.items():
            self._counts[channel_id] += count
        self._start_ns, self._end_ns = min(self._start_ns, start_ns), max(self._end_ns, end_ns)

    def flush(self) -> None:
        """Hand everything written to the operating system."""
        self._stream.flush()

    def finish(self) -> None:
        """Write summary and footer and close the file."""
        self._append(DataEnd(data_section_crc=0))
        summary_start = self._stream.tell()
        groups = {
            Opcode.SCHEMA: self._definitions[Opcode.SCHEMA],
            Opcode.CHANNEL: self._definitions[Opcode.CHANNEL],
            Opcode.STATISTICS: [_encode(self._statistics())],
            **self._indexes,
        }
        summary, offsets = bytearray(), bytearray()
        for opcode, records in groups.items():
            if records:
                start = summary_start + len(summary)
                summary += b"".join(records)
                length = summary_start + len(summary) - start
                offsets += _encode(SummaryOffset(group_opcode=opcode, group_start=start, group_length=length))
        offset_start = summary_start + len(summary)
        summary += offsets
        # the summary's check sum runs over the footer up to the check sum itself
        footer_start = struct.pack("<BQQQ", Opcode.FOOTER, 20, summary_start, offset_start)
        crc = zlib.crc32(footer_start, zlib.crc32(summary))
        self._stream.write(summary)
        self._append(Footer(summary_start=summary_start, summary_offset_start=offset_start, summary_crc=crc))
        self._stream.write(MCAP0_MAGIC)
        self._stream.close()

    def abandon(self) -> None:
        """Close the file as it is, without a summary."""
        self._stream.close()

    def _append(self, record: _Record) -> tuple[int, int]:
        """Write a record; return where it starts and how long it is."""
        offset = self._stream.tell()
        data = _encode(record)
        self._stream.write(data)
        return offset, len(data)

    def _statistics(self) -> Statistics:
        start_ns, end_ns = self.time_range_ns
        return Statistics(
            attachment_count=len(self._indexes[Opcode.ATTACHMENT_INDEX]),
            channel_count=len(self._counts),
            channel_message_counts=dict(self._counts),
            chunk_count=len(self._indexes[Opcode.CHUNK_INDEX]),
            message_count=sum(self._counts.values()),
            message_end_time=end_ns,
            message_start_time=start_ns,
            metadata_count=len(self._indexes[Opcode.METADATA_INDEX]),
            schema_count=len(self._definitions[Opcode.SCHEMA]),
        )


def _compressor(compression: Compression) -> Callable[[bytearray], bytes]:
    match compression:
        case Compression.NONE:
            return bytes
        case Compression.LZ4:
            return cast("Callable[[bytearray], bytes]", lz4.frame.compress)
        case Compression.ZSTD:
            return zstandard.ZstdCompressor(level=_ZSTD_LEVEL).compress


def _encode(record: _Record) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return bytes(cast("bytes", builder.end()))  # type: ignore[no-untyped-call] # mcap leaves it without a type
