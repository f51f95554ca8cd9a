"""The summary section of an MCAP file: what it holds and where, once its check sum is verified."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mcap.opcode import Opcode
from mcap.records import Channel, Footer, Schema, Statistics

from bags.mcap.chunk_table import ChunkEntry, ChunkTable, chunk_table, read_entry
from bags.mcap.file_bytes import FileBytes
from bags.mcap.frames import FRAME, HEAD, MAGIC, ends_with_magic, read_frame

NO_SUMMARY = "the file has no summary"
_FOOTER_LENGTH = FRAME + 20


@dataclass(frozen=True, slots=True, kw_only=True)
class SummarySection:
    """The summary of a file, its check sum verified.

    Attributes:
        start: Where it starts.
        checked: Whether it has a check sum.
        schemas: By id.
        channels: By id.
        chunks: The chunk indexes.
        attachments: Where attachments start.
        metadata: Where metadata records start.
        statistics: None if it holds none.
    """

    start: int
    checked: bool
    schemas: Mapping[int, Schema]
    channels: Mapping[int, Channel]
    chunks: ChunkTable
    attachments: tuple[int, ...]
    metadata: tuple[int, ...]
    statistics: Statistics | None

    @property
    def describes(self) -> bool:
        """Whether it repeats the channels and their schemas, as it may."""
        return bool(self.channels) and {one.schema_id for one in self.channels.values()} <= {0, *self.schemas}


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
        return NO_SUMMARY
    if not len(MAGIC) <= footer.summary_start <= at:
        return f"the footer points to a summary at {footer.summary_start}, outside the file's {source.size} bytes"
    crc = source.crc32(footer.summary_start, source.size - len(MAGIC) - 4)
    if footer.summary_crc and crc != footer.summary_crc:
        return f"the summary's check sum is {crc:08x}, its footer promises {footer.summary_crc:08x}"
    return _parse_summary(source, footer, at)


def _parse_summary(source: FileBytes, footer: Footer, end: int) -> SummarySection | str:
    found: dict[int, list[Any]] = {}
    chunks: list[ChunkEntry] = []
    at = footer.summary_start
    while at < end:
        opcode, length = HEAD.unpack(source.read(at, FRAME).ljust(FRAME, b"\0"))
        if opcode == Opcode.CHUNK_INDEX and at + FRAME + length <= end:
            entry = read_entry(source.read(at + FRAME, length), at + FRAME)
            if entry is None:
                return f"the summary holds no sound chunk index at {at}"
            chunks.append(entry)
            at += FRAME + length
            continue
        frame = read_frame(source, at, end)
        if frame is None:
            return f"the summary holds no sound record at {at}"
        found.setdefault(frame.opcode, []).append(frame.record)
        at = frame.end
    statistics = found.get(Opcode.STATISTICS, [None])
    return SummarySection(
        start=footer.summary_start,
        checked=bool(footer.summary_crc),
        schemas={one.id: one for one in found.get(Opcode.SCHEMA, ())},
        channels={one.id: one for one in found.get(Opcode.CHANNEL, ())},
        chunks=chunk_table(chunks),
        attachments=tuple(one.offset for one in found.get(Opcode.ATTACHMENT_INDEX, ())),
        metadata=tuple(one.offset for one in found.get(Opcode.METADATA_INDEX, ())),
        statistics=statistics[0],
    )
