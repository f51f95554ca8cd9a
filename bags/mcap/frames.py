"""One record of an MCAP file at a position, trusted only when its content fills its length exactly."""

import struct
import zlib
from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from typing import Any

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)

from bags.mcap.file_bytes import FileBytes

MAGIC = b"\x89MCAP0\r\n"
FRAME = 9  # opcode and length of a record
HEAD = struct.Struct("<BQ")
_READERS: dict[int, Any] = {
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.ATTACHMENT: Attachment,
    Opcode.METADATA: Metadata,
    Opcode.DATA_END: DataEnd,
    Opcode.STATISTICS: Statistics,
    Opcode.FOOTER: Footer,
    Opcode.ATTACHMENT_INDEX: AttachmentIndex,
    Opcode.METADATA_INDEX: MetadataIndex,
}


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


def ends_with_magic(source: FileBytes) -> bool:
    """Whether the file ends as a complete one does."""
    return source.size >= 2 * len(MAGIC) and source.read(source.size - len(MAGIC), len(MAGIC)) == MAGIC


def read_frame(source: FileBytes, start: int, limit: int) -> Frame | None:
    """The record at a position, None unless it ends before the limit and its content fills it exactly."""
    head = source.read(start, FRAME)
    if len(head) < FRAME:
        return None
    opcode, length = HEAD.unpack(head)
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


def _fits(opcode: int, body: bytes) -> bool:
    if opcode == Opcode.MESSAGE_INDEX:
        size = len(body) - 6  # channel id and length of the entries
        return size >= 0 and size % 16 == 0 and struct.unpack_from("<I", body, 2)[0] == size
    return True
