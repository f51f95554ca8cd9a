"""Going through a possibly damaged MCAP file: what is sound, and where it is not.

A chunk is sound when its check sum says so, whatever became of the fields around it: the index in the summary, the
length of its record and the length of its data each lead to its end, and one of them is enough.
"""

import struct
import zlib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any, final

import numpy as np
from mcap.data_stream import ReadDataStream
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
)
from numpy.typing import NDArray

from bags.errors import BagError
from bags.expand import expand
from bags.file_bytes import FileBytes
from bags.messages import MessageTable, table_by_index, walk

MAGIC = b"\x89MCAP0\r\n"
FRAME = 9  # opcode and length of a record
_FOOTER_LENGTH = FRAME + 20
_CHUNK_FIELDS = struct.Struct("<BQQQQII")
_HEAD = struct.Struct("<BQ")
_NAMES = {0: "", 3: "lz4", 4: "zstd"}  # by length, which survives a wrong letter
_READERS: dict[int, Any] = {
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.ATTACHMENT: Attachment,
    Opcode.METADATA: Metadata,
    Opcode.DATA_END: DataEnd,
    Opcode.STATISTICS: Statistics,
    Opcode.FOOTER: Footer,
    Opcode.CHUNK_INDEX: ChunkIndex,
    Opcode.ATTACHMENT_INDEX: AttachmentIndex,
    Opcode.METADATA_INDEX: MetadataIndex,
}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """A record whose content fits its length exactly.

    Attributes:
        opcode: Its kind.
        start: Where it starts in the file.
        end: Where it ends.
        record: Its content as the `mcap` library reads it; raw bytes for kinds that need no more.
    """

    opcode: int
    start: int
    end: int
    record: Any


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SoundChunk:
    """A chunk whose content agrees with its check sum.

    Attributes:
        start: Where it starts in the file.
        end: Where it ends.
        fields: Length, times, size and compression as they stand in its head, as one tuple to compare.
        compression: MCAP's name.
        content: Uncompressed.
    """

    start: int
    end: int
    fields: tuple[int, ...]
    compression: str
    content: bytes


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Messages:
    """The messages of a sound chunk.

    Attributes:
        chunk: The chunk.
        table: Its messages.
        indexed: Whether the message index that follows the chunk agrees.
        end: Where the message index ends in the file.
    """

    chunk: SoundChunk
    table: MessageTable
    indexed: bool
    end: int


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """Bytes that are not what they must be.

    Attributes:
        start: Where in the file.
        what: In words.
        breaks_off: Whether the file ends inside a record.
    """

    start: int
    what: str
    breaks_off: bool = False


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SummarySection:
    """The summary of a file, its check sum verified.

    Attributes:
        start: Where it starts.
        checked: Whether it has a check sum.
        schemas: By id.
        channels: By id.
        chunks: Chunk indexes by the start of the chunk.
        others: Where indexed attachments and metadata start.
        statistics: None if it holds none.
    """

    start: int
    checked: bool
    schemas: Mapping[int, Schema] = field(default_factory=dict)
    channels: Mapping[int, Channel] = field(default_factory=dict)
    chunks: Mapping[int, ChunkIndex] = field(default_factory=dict)
    others: tuple[int, ...] = ()
    statistics: Statistics | None = None


def ends_with_magic(source: FileBytes) -> bool:
    """Whether the file ends as a complete one does."""
    return source.size >= 2 * len(MAGIC) and source.read(source.size - len(MAGIC), len(MAGIC)) == MAGIC


def summary_of(source: FileBytes) -> SummarySection | str:
    """The summary, or one sentence on why it cannot be trusted."""
    if not ends_with_magic(source):
        return "the file breaks off without an MCAP footer, as when its recorder was killed"
    at = source.size - len(MAGIC) - _FOOTER_LENGTH
    frame = read_frame(source, at, source.size - len(MAGIC))
    if frame is None or frame.opcode != Opcode.FOOTER:
        return "the footer is damaged"
    footer: Footer = frame.record
    if not footer.summary_start:
        return "the file has no summary"
    if not len(MAGIC) <= footer.summary_start <= at:
        return f"the footer points to a summary at {footer.summary_start}, outside the file's {source.size} bytes"
    crc = source.crc32(footer.summary_start, source.size - len(MAGIC) - 4)
    if footer.summary_crc and crc != footer.summary_crc:
        return f"the summary's check sum is {crc:08x}, its footer promises {footer.summary_crc:08x}"
    return _parse_summary(source, footer, at)


def _parse_summary(source: FileBytes, footer: Footer, end: int) -> SummarySection | str:
    found: dict[int, list[Any]] = {}
    at = footer.summary_start
    while at < end:
        frame = read_frame(source, at, end)
        if frame is None:
            return f"the summary holds no sound record at {at}"
        found.setdefault(frame.opcode, []).append(frame.record)
        at = frame.end
    others = [*found.get(Opcode.ATTACHMENT_INDEX, ()), *found.get(Opcode.METADATA_INDEX, ())]
    statistics = found.get(Opcode.STATISTICS, [None])
    return SummarySection(
        start=footer.summary_start,
        checked=bool(footer.summary_crc),
        schemas={one.id: one for one in found.get(Opcode.SCHEMA, ())},
        channels={one.id: one for one in found.get(Opcode.CHANNEL, ())},
        chunks={one.chunk_start_offset: one for one in found.get(Opcode.CHUNK_INDEX, ())},
        others=tuple(one.offset for one in others),
        statistics=statistics[0],
    )


def read_frame(source: FileBytes, start: int, limit: int) -> Frame | None:
    """The record at a position, None unless it ends before the limit and its content fills it exactly."""
    head = source.read(start, FRAME)
    if len(head) < FRAME:
        return None
    opcode, length = _HEAD.unpack(head)
    end = start + FRAME + length
    if end > limit or not Opcode.HEADER <= opcode <= Opcode.DATA_END or opcode == Opcode.CHUNK:
        return None
    body = source.read(start + FRAME, length)
    if opcode not in _READERS:
        return Frame(opcode=opcode, start=start, end=end, record=body) if _fits(opcode, body) else None
    stream = ReadDataStream(BytesIO(body))
    with suppress(Exception):  # the library raises whatever the damaged bytes lead to
        record = _READERS[opcode].read(stream)
        sealed = opcode != Opcode.ATTACHMENT or struct.unpack("<I", body[-4:])[0] in (0, zlib.crc32(body[:-4]))
        if stream.count == length and sealed:
            return Frame(opcode=opcode, start=start, end=end, record=record)
    return None


def parse_definition(opcode: int, body: bytes) -> Any:  # noqa: ANN401 - a Schema or a Channel
    """A schema or channel record inside a chunk, None when it is damaged."""
    with suppress(Exception):  # the library raises whatever the damaged bytes lead to
        return _READERS[opcode].read(ReadDataStream(BytesIO(body)))
    return None


def read_chunk(source: FileBytes, start: int, limit: int, index: ChunkIndex | None) -> SoundChunk | None:
    """The chunk at a position, None unless its check sum agrees with a content that consists of records."""
    head = source.read(start, _CHUNK_FIELDS.size + 4 + 8)
    if len(head) < _CHUNK_FIELDS.size + 8:
        return None
    opcode, length, start_ns, end_ns, size, crc, letters = _CHUNK_FIELDS.unpack_from(head)
    fields = (opcode, length, start_ns, end_ns, size)
    tries: list[tuple[str, int, int]] = []
    if index is not None:
        end = start + index.chunk_length
        tries.append((index.compression, end - index.compressed_size, end))
    if letters in _NAMES:
        at = start + _CHUNK_FIELDS.size + letters + 8
        (inner,) = struct.unpack("<Q", source.read(at - 8, 8).ljust(8, b"\xff"))
        ends = (start + FRAME + length, at + inner) if crc else (start + FRAME + length,)
        tries += [(_NAMES[letters], at, end) for end in dict.fromkeys(ends)]
    for compression, at, end in tries:
        if not start < at <= end <= limit:
            continue
        with suppress(BagError):
            content = expand(compression, source.read(at, end - at))
            if zlib.crc32(content) == crc if crc else (opcode == Opcode.CHUNK and len(content) == size):
                return SoundChunk(start=start, end=end, fields=fields, compression=compression, content=content)
    return None


def scan(source: FileBytes, summary: SummarySection | None) -> Iterator[Frame | SoundChunk | Fault]:
    """Everything between the magics, in order; the summary's own records are left out when it is sound."""
    limit = source.size - len(MAGIC) if ends_with_magic(source) else source.size
    indexes = summary.chunks if summary else {}
    landmarks = sorted({*indexes, *summary.others, summary.start}) if summary else []
    limit = summary.start if summary else limit
    at = len(MAGIC)
    while at < limit:
        index = indexes.get(at)
        opcode = source.read(at, 1)[0]
        found: Frame | SoundChunk | None = None
        if opcode == Opcode.CHUNK or index is not None:
            found = read_chunk(source, at, limit, index)
        if found is None and index is None:
            found = read_frame(source, at, limit)
        if found is not None:
            yield found
            at = found.end
            continue
        following = _following(source, at, limit, landmarks)
        yield _fault(source, at, limit, following)
        if following is None:
            return
        at = following


def survey(source: FileBytes, summary: SummarySection | None) -> Iterator[Frame | Messages | Fault]:
    """As `scan`, with every chunk and the message indexes that follow it taken together."""
    chunk: SoundChunk | None = None
    index: dict[int, NDArray[np.int64]] = {}
    end = 0
    for found in scan(source, summary):
        if chunk is not None and isinstance(found, Frame) and found.opcode == Opcode.MESSAGE_INDEX:
            (channel_id,) = struct.unpack_from("<H", found.record)
            index[channel_id] = np.frombuffer(found.record[6:], dtype="<i8").reshape(-1, 2)
            end = found.end
            continue
        if chunk is not None:
            yield _messages(chunk, index, end)
        chunk, index = None, {}
        if isinstance(found, SoundChunk):
            chunk, end = found, found.end
        else:
            yield found
    if chunk is not None:
        yield _messages(chunk, index, end)


def _messages(chunk: SoundChunk, index: Mapping[int, NDArray[np.int64]], end: int) -> Messages:
    table = table_by_index(chunk.content, index)
    if table is not None:
        return Messages(chunk=chunk, table=table, indexed=True, end=end)
    table = walk(chunk.content)
    return Messages(chunk=chunk, table=table, indexed=_agrees(table, index), end=end)


def _agrees(table: MessageTable, index: Mapping[int, NDArray[np.int64]]) -> bool:
    """Whether an index, if there is one, lists exactly the messages that are there."""
    listed = {(channel_id, time, offset) for channel_id, entries in index.items() for time, offset in entries.tolist()}
    there = set(zip(table.channel_ids.tolist(), table.log_times.tolist(), table.starts.tolist(), strict=True))
    return listed == there or not index


def _following(source: FileBytes, at: int, limit: int, landmarks: list[int]) -> int | None:
    """Where sound records may go on behind a broken one."""
    head = source.read(at, FRAME)
    opcode, length = _HEAD.unpack(head) if len(head) == FRAME else (0, limit)
    end = at + FRAME + length
    known: int | None = next((one for one in landmarks if one > at), None)
    if end < limit and Opcode.HEADER <= opcode <= Opcode.DATA_END and (known is None or end <= known):
        following = source.read(end, FRAME)
        if len(following) == FRAME:
            next_opcode, next_length = _HEAD.unpack(following)
            if Opcode.HEADER <= next_opcode <= Opcode.DATA_END and end + FRAME + int(next_length) <= limit:
                return int(end)
    if known is not None:
        return known
    position = source.find_chunk(at + 1)
    while position is not None and position < limit:
        if read_chunk(source, position, limit, None) is not None:
            return position
        position = source.find_chunk(position + 1)
    return None


def _fault(source: FileBytes, at: int, limit: int, following: int | None) -> Fault:
    head = source.read(at, FRAME)
    opcode, length = _HEAD.unpack(head) if len(head) == FRAME else (0, 0)
    name = Opcode(opcode).name.lower().replace("_", " ") if opcode in set(Opcode) else f"record of kind {opcode}"
    beyond = len(head) < FRAME or at + FRAME + length > limit
    if beyond and following is None and limit == source.size:
        return Fault(start=at, what=f"the file breaks off in a {name}", breaks_off=True)
    return Fault(start=at, what=f"{name} is damaged")


def _fits(opcode: int, body: bytes) -> bool:
    if opcode == Opcode.MESSAGE_INDEX:
        size = len(body) - 6  # channel id and length of the entries
        return size >= 0 and size % 16 == 0 and struct.unpack_from("<I", body, 2)[0] == size
    return True
