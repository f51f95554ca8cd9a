"""Going through a possibly damaged MCAP file: what is sound, and where it is not.

A chunk is sound when its check sum says so, whatever became of the fields around it: the index in the summary, the
length of its record and the length of its data each lead to its end, and one of them is enough.
"""

import struct
import zlib
from bisect import bisect_right
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from bags.mcap.chunk_table import ChunkEntry
from bags.mcap.errors import BagError
from bags.mcap.expand import expand
from bags.mcap.file_bytes import FileBytes
from bags.mcap.frames import FRAME, HEAD, MAGIC, Frame, ends_with_magic, read_frame
from bags.mcap.messages import MessageTable, table_by_index, walk
from bags.mcap.summary_section import SummarySection

_CHUNK_FIELDS = struct.Struct("<BQQQQII")
_LOOKED_AT = 4  # times the size of a file may be read in search of its next sound chunk
_ALWAYS = 64_000_000
_HEAD_COST = 64
_NAMES = {0: "", 3: "lz4", 4: "zstd"}  # by length, which survives a wrong letter
_OPCODES = frozenset(map(int, Opcode))


@dataclass(frozen=True, slots=True, kw_only=True)
class SoundChunk:
    """A chunk whose content agrees with its check sum.

    Attributes:
        start: Where it starts in the file.
        end: Where it ends.
        fields: Length, times, size and compression as they stand in its head, as one tuple to compare.
        compression: MCAP's name.
        content: Uncompressed.
        checked: Whether a check sum vouches for it; a chunk may have none.
    """

    start: int
    end: int
    fields: tuple[int, ...]
    compression: str
    content: bytes
    checked: bool = True


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


def read_chunk(source: FileBytes, start: int, limit: int, index: ChunkEntry | None) -> SoundChunk | None:
    """The chunk at a position, None unless its check sum agrees with a content that consists of records."""
    head = source.read(start, _CHUNK_FIELDS.size + 4 + 8)
    if len(head) < _CHUNK_FIELDS.size + 8:
        return None
    opcode, length, start_ns, end_ns, size, crc, letters = _CHUNK_FIELDS.unpack_from(head)
    fields = (opcode, length, start_ns, end_ns, size)
    tries: list[tuple[str, int, int]] = []
    if letters in _NAMES:
        at = start + _CHUNK_FIELDS.size + letters + 8
        (inner,) = struct.unpack("<Q", source.read(at - 8, 8).ljust(8, b"\xff"))
        ends = (start + FRAME + length, at + inner) if crc else (start + FRAME + length,)
        tries += [(_NAMES[letters], at, end) for end in dict.fromkeys(ends)]
    if index is not None:
        end = start + index.length
        of_index = (index.compression, end - index.compressed_size, end)
        # what a record says of its own end twice comes first: an index can be that of a chunk which stood here before
        tries.insert(1 if len(tries) == 1 else 0, of_index)
    for compression, at, end in tries:
        if not start < at <= end <= limit:
            continue
        with suppress(BagError):
            content = expand(compression, source.read(at, end - at))
            if zlib.crc32(content) == crc if crc else (opcode == Opcode.CHUNK and len(content) == size):
                return SoundChunk(
                    start=start,
                    end=end,
                    fields=fields,
                    compression=compression,
                    content=content,
                    checked=bool(crc),
                )
    return None


def scan(source: FileBytes, summary: SummarySection | None) -> Iterator[Frame | SoundChunk | Fault]:
    """Everything between the magics, in order; the summary's own records are left out when it is sound."""
    limit = source.size - len(MAGIC) if ends_with_magic(source) else source.size
    landmarks = _landmarks(summary) if summary else []
    limit = summary.start if summary else limit
    at = len(MAGIC)
    while at < limit:
        index = summary.chunks.at(at) if summary else None
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


def _landmarks(summary: SummarySection) -> list[int]:
    """Where something starts according to the summary, ascending."""
    return sorted({*summary.chunks.starts, *summary.attachments, *summary.metadata, summary.start})


def _following(source: FileBytes, at: int, limit: int, landmarks: list[int]) -> int | None:
    """Where sound records may go on behind a broken one."""
    head = source.read(at, FRAME)
    opcode, length = HEAD.unpack(head) if len(head) == FRAME else (0, limit)
    end = at + FRAME + length
    behind = bisect_right(landmarks, at)
    known: int | None = landmarks[behind] if behind < len(landmarks) else None
    if end < limit and Opcode.HEADER <= opcode <= Opcode.DATA_END and (known is None or end <= known):
        following = source.read(end, FRAME)
        if len(following) == FRAME:
            next_opcode, next_length = HEAD.unpack(following)
            if Opcode.HEADER <= next_opcode <= Opcode.DATA_END and end + FRAME + int(next_length) <= limit:
                return int(end)
    if known is not None:
        return known
    budget = _LOOKED_AT * source.size + _ALWAYS
    for position in source.find_chunks(at + 1):
        budget -= _claimed(source, position, limit)
        if position >= limit or budget < 0:  # what looks like a million chunks is none of them
            return None
        if read_chunk(source, position, limit, None) is not None:
            return position
    return None


def _claimed(source: FileBytes, at: int, limit: int) -> int:
    """Bytes that reading what looks like a chunk would take."""
    length = int.from_bytes(source.read(at + 1, 8), "little")
    return _HEAD_COST + (length if at + FRAME + length <= limit else 0)


def _fault(source: FileBytes, at: int, limit: int, following: int | None) -> Fault:
    head = source.read(at, FRAME)
    opcode, length = HEAD.unpack(head) if len(head) == FRAME else (0, 0)
    name = Opcode(opcode).name.lower().replace("_", " ") if opcode in _OPCODES else f"record of kind {opcode}"
    beyond = len(head) < FRAME or at + FRAME + length > limit
    if beyond and following is None and limit == source.size:
        return Fault(start=at, what=f"the file breaks off in a {name}", breaks_off=True)
    return Fault(start=at, what=f"{name} is damaged")
