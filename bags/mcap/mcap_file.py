"""An MCAP file being written: records of the `mcap` library around message chunks that we fill ourselves.

The library's own writer takes one message at a time. This one also takes the bytes of many messages at once, because
the offline simulation writes hundreds of thousands of messages a second. Chunks go to the operating system as soon
as they are closed, so what a killed process loses is the open chunk. When the disk refuses, the file is cut back to
its last complete chunk, and further while there is no room for the summary.
"""

import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
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

from bags.mcap.chunk import ENTRY_BYTES, INDEX_HEAD, RECORD_HEAD_BYTES, OpenChunk
from bags.mcap.packing import Compression, PackedChunk, Record, encode, packer

OURS = "dcmg; "  # who wrote a file: what we wrote can be checked more strictly
_RECORDS_AT_ONCE = 1000  # of the summary


@dataclass(frozen=True, slots=True, kw_only=True)
class _Mark:
    """What the file was before one of its chunks, so that the chunk can be taken back; an hour has 30,000 of them."""

    position: int
    crc: int
    length: int  # bytes of the chunk
    time_range_ns: tuple[int, int]


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
        self._stream = path.open("x+b", buffering=0)
        self._position, self._crc = 0, 0
        self._marks: list[_Mark] = []
        self._pack = packer(compression)
        self._definitions: dict[Opcode, list[bytes]] = {Opcode.SCHEMA: [], Opcode.CHANNEL: []}
        self._indexes: dict[Opcode, list[bytes]] = {
            Opcode.CHUNK_INDEX: [],
            Opcode.ATTACHMENT_INDEX: [],
            Opcode.METADATA_INDEX: [],
        }
        self._counts: dict[int, int] = {}  # messages by channel id
        self._start_ns, self._end_ns = 2**64 - 1, 0
        self._write(MCAP0_MAGIC)
        self._append(Header(profile=profile, library=f"{OURS}{LIBRARY_IDENTIFIER}"))

    @property
    def time_range_ns(self) -> tuple[int, int]:
        """Earliest and latest log time [ns]; (0, 0) without messages."""
        return (self._start_ns, self._end_ns) if self._indexes[Opcode.CHUNK_INDEX] else (0, 0)

    @property
    def size(self) -> int:
        """Bytes in the file."""
        return self._position

    @property
    def counts(self) -> Mapping[int, int]:
        """Messages in the file by channel id; the open chunk does not count."""
        return dict(self._counts)

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Append a schema and return its id."""
        known = self._definitions[Opcode.SCHEMA]
        record = encode(Schema(id=len(known) + 1, name=name, encoding=encoding, data=data))
        known.append(record)
        self._write(record)
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
        record = encode(channel)
        known.append(record)
        self._write(record)
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
        self._indexes[Opcode.ATTACHMENT_INDEX].append(encode(index))

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Append a metadata record."""
        offset, length = self._append(Metadata(name=name, metadata=dict(values)))
        self._indexes[Opcode.METADATA_INDEX].append(encode(MetadataIndex(offset=offset, length=length, name=name)))

    def add_chunk(self, chunk: OpenChunk) -> None:
        """Close a chunk and write it.

        Raises:
            OSError: The disk refuses; the file is cut back to the chunk before.
        """
        self.add_packed(self._pack(chunk))

    def add_packed(self, chunk: PackedChunk) -> None:
        """Write a chunk with its message indexes and hand all to the operating system.

        Raises:
            OSError: The disk refuses; the file is cut back to the chunk before.
        """
        offset, crc = self._position, self._crc
        try:
            self._write(chunk.record)
            self._write(chunk.index_records)
        except OSError:
            self._cut(offset, crc)
            raise
        start_ns, end_ns = chunk.time_range_ns
        behind = offset + len(chunk.record)
        index = ChunkIndex(
            message_start_time=start_ns,
            message_end_time=end_ns,
            chunk_start_offset=offset,
            chunk_length=len(chunk.record),
            message_index_offsets={channel_id: behind + at for channel_id, at in chunk.offsets.items()},
            message_index_length=len(chunk.index_records),
            compression=chunk.compression,
            compressed_size=chunk.compressed_size,
            uncompressed_size=chunk.uncompressed_size,
        )
        self._indexes[Opcode.CHUNK_INDEX].append(encode(index))
        before = (self._start_ns, self._end_ns)
        self._marks.append(_Mark(position=offset, crc=crc, length=len(chunk.record), time_range_ns=before))
        for channel_id, count in chunk.counts.items():
            self._counts[channel_id] += count
        self._start_ns, self._end_ns = min(self._start_ns, start_ns), max(self._end_ns, end_ns)

    def drop_last_chunk(self) -> bool:
        """Take the last chunk back, with everything behind it, to make room; False when there is none.

        Attachments and metadata behind the chunk go with it.
        """
        if not self._marks:
            return False
        mark = self._marks.pop()
        self._indexes[Opcode.CHUNK_INDEX].pop()
        for channel_id, count in self._counts_behind(mark.position + mark.length):
            self._counts[channel_id] -= count
        self._start_ns, self._end_ns = mark.time_range_ns
        for kind in (Opcode.ATTACHMENT_INDEX, Opcode.METADATA_INDEX):
            # an index record starts with opcode, length and the offset of what it points to
            kept = [one for one in self._indexes[kind] if struct.unpack_from("<Q", one, 9)[0] < mark.position]
            self._indexes[kind] = kept
        self._cut(mark.position, mark.crc)
        return True

    def _counts_behind(self, position: int) -> Iterator[tuple[int, int]]:
        """Channel and number of messages of each message index from a position on: keeping them would cost memory."""
        while position < self._position:
            self._stream.seek(position)
            opcode, length, channel_id, size = INDEX_HEAD.unpack(self._stream.read(INDEX_HEAD.size))
            if opcode != Opcode.MESSAGE_INDEX:
                return
            yield channel_id, size // ENTRY_BYTES
            position += RECORD_HEAD_BYTES + length

    def finish(self, metadata: Mapping[str, Mapping[str, str]] | None = None) -> None:
        """Write summary and footer.

        Args:
            metadata: Metadata records to put before the summary, by name.

        Raises:
            OSError: The disk refuses; the file is cut back to what it was.
        """
        position, crc, known = self._position, self._crc, list(self._indexes[Opcode.METADATA_INDEX])
        try:
            for name, values in (metadata or {}).items():
                self.add_metadata(name, values)
            self._append(DataEnd(data_section_crc=self._crc))
            self._write_summary()
            self._write(MCAP0_MAGIC)
        except OSError:
            self._indexes[Opcode.METADATA_INDEX] = known
            self._cut(position, crc)
            raise

    def close(self) -> None:
        """Close the file as it is."""
        self._stream.close()

    def _write_summary(self) -> None:
        """Summary section and footer, piece by piece: those of an hour are 20 MB."""
        start, self._crc = self._position, 0
        groups = {
            Opcode.SCHEMA: self._definitions[Opcode.SCHEMA],
            Opcode.CHANNEL: self._definitions[Opcode.CHANNEL],
            Opcode.STATISTICS: [encode(self._statistics())],
            **self._indexes,
        }
        offsets = bytearray()
        for opcode, records in groups.items():
            at = self._position
            for first in range(0, len(records), _RECORDS_AT_ONCE):
                self._write(b"".join(records[first : first + _RECORDS_AT_ONCE]))
            if records:
                length = self._position - at
                offsets += encode(SummaryOffset(group_opcode=opcode, group_start=at, group_length=length))
        offset_start = self._position
        self._write(offsets)
        # the summary's check sum runs over the footer up to the check sum itself
        crc = zlib.crc32(struct.pack("<BQQQ", Opcode.FOOTER, 20, start, offset_start), self._crc)
        self._write(encode(Footer(summary_start=start, summary_offset_start=offset_start, summary_crc=crc)))

    def _cut(self, position: int, crc: int) -> None:
        self._stream.truncate(position)
        self._stream.seek(position)
        self._position, self._crc = position, crc

    def _write(self, data: bytes | bytearray) -> None:
        """Hand bytes to the operating system: a killed process leaves them behind.

        Raises:
            OSError: The disk refuses.
        """
        left = memoryview(data)
        while left:
            left = left[self._stream.write(left) :]
        self._position += len(data)
        self._crc = zlib.crc32(data, self._crc)

    def _append(self, record: Record) -> tuple[int, int]:
        """Write a record; return where it starts and how long it is."""
        offset = self._position
        data = encode(record)
        self._write(data)
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
