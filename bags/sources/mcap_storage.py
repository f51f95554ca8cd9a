"""One MCAP file, read from its first record to its last: neither message index nor summary need be there."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mcap.opcode import Opcode

from bags.mcap.chunk import MESSAGE_HEAD, MESSAGE_HEAD_LENGTH
from bags.mcap.definitions import Definition
from bags.mcap.errors import BagError
from bags.mcap.file_bytes import FileBytes
from bags.mcap.frames import FRAME, Frame, parse_definition, read_frame
from bags.mcap.scan import Fault, Messages, survey
from bags.mcap.summary_section import NO_SUMMARY, SummarySection, summary_of
from bags.sources.latching import is_latched
from bags.sources.source import Channel, RawMessage

_BODY = FRAME + MESSAGE_HEAD_LENGTH


@dataclass(frozen=True, slots=True, kw_only=True)
class McapStorage:
    """An MCAP file opened for reading.

    Attributes:
        path: The file.
        channels: Its channels with the number of messages that the file promises, or that are there where it
            promises nothing.
        attachments: Documents in it by name.
    """

    path: Path
    channels: Mapping[Channel, int]
    attachments: Mapping[str, bytes]
    _source: FileBytes
    _summary: SummarySection | None
    _by_id: Mapping[int, Channel]

    def messages(self, wanted: Collection[Channel]) -> Iterator[RawMessage]:
        """Messages of some channels, in the order of the file.

        Raises:
            BagError: The file is damaged, or holds a channel that its summary does not list.
        """
        by_id = {number: one if one in wanted else None for number, one in self._by_id.items()}
        unpack = MESSAGE_HEAD.unpack_from
        for found in _records(self.path, self._source, self._summary):
            if isinstance(found, Frame):
                if found.opcode == Opcode.MESSAGE:
                    number, _, time_ns, _ = _message_fields(found.record)
                    channel = self._known(by_id, number)
                    if channel is not None:
                        yield RawMessage(channel, time_ns, found.record[MESSAGE_HEAD_LENGTH:])
                continue
            content, table = found.chunk.content, found.table
            numbers = np.unique(table.channel_ids).tolist()
            of_interest = [number for number in numbers if self._known(by_id, number) is not None]
            rows = np.flatnonzero(np.isin(table.channel_ids, of_interest))
            for start, end, number in zip(
                table.starts[rows].tolist(), table.ends[rows].tolist(), table.channel_ids[rows].tolist(), strict=True
            ):
                channel = by_id[number]
                if channel is not None:
                    yield RawMessage(channel, unpack(content, start)[4], content[start + _BODY : end])

    def close(self) -> None:
        """Close the file."""
        self._source.close()

    def _known(self, by_id: Mapping[int, Channel | None], number: int) -> Channel | None:
        if number not in by_id:
            raise BagError(
                f"{self.path}: holds messages of a channel {number} that it does not describe: "
                f"`dcmg bag check {self.path}` says what is intact"
            )
        return by_id[number]


def open_mcap(path: Path, types: Mapping[str, str]) -> McapStorage:
    """Open an MCAP file.

    Args:
        path: The file.
        types: Message type of topics whose channels have no schema, as metadata.yaml says.

    Raises:
        BagError: It breaks off, is damaged, or is none.
    """
    source = FileBytes(path)
    try:
        summary = _summary(path, source)
        schemas, channels, counts = _from_summary(summary) or _from_data(path, source, summary)
        by_id = {number: _channel(one, schemas, types) for number, one in channels.items()}
        promised: dict[Channel, int] = dict.fromkeys(by_id.values(), 0)
        for number, channel in by_id.items():
            promised[channel] += counts.get(number, 0)
        return McapStorage(
            path=path,
            channels=promised,
            attachments=_attachments(source, summary),
            _source=source,
            _summary=summary,
            _by_id=by_id,
        )
    except BaseException:
        source.close()
        raise


def _summary(path: Path, source: FileBytes) -> SummarySection | None:
    """The summary, None for a file that never had one."""
    found = summary_of(source)
    if isinstance(found, SummarySection):
        return found
    if found != NO_SUMMARY:
        raise BagError(f"{path}: {found}: `dcmg bag repair {path}` keeps what is intact")
    return None


def _from_summary(summary: SummarySection | None) -> tuple[dict[int, Any], dict[int, Any], dict[int, int]] | None:
    """Schemas, channels and counts by id, None unless the summary has them all."""
    if summary is None or summary.statistics is None:
        return None
    counts = {number: count for number, count in summary.statistics.channel_message_counts.items() if count}
    if sum(counts.values()) != summary.statistics.message_count or not set(counts) <= set(summary.channels):
        return None
    if any(one.schema_id and one.schema_id not in summary.schemas for one in summary.channels.values()):
        return None
    return dict(summary.schemas), dict(summary.channels), counts


def _from_data(
    path: Path, source: FileBytes, summary: SummarySection | None
) -> tuple[dict[int, Any], dict[int, Any], dict[int, int]]:
    """The same, by going through the file."""
    schemas: dict[int, Any] = dict(summary.schemas) if summary else {}
    channels: dict[int, Any] = dict(summary.channels) if summary else {}
    counts: dict[int, int] = {}
    for found in _records(path, source, summary):
        if isinstance(found, Frame):
            if found.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                (schemas if found.opcode == Opcode.SCHEMA else channels)[found.record.id] = found.record
            elif found.opcode == Opcode.MESSAGE:
                number = _message_fields(found.record)[0]
                counts[number] = counts.get(number, 0) + 1
            continue
        for opcode, start, end in found.table.definitions:
            record = parse_definition(opcode, found.chunk.content[start:end])
            if record is not None:
                (schemas if opcode == Opcode.SCHEMA else channels)[record.id] = record
        for number in found.table.channel_ids.tolist():
            counts[number] = counts.get(number, 0) + 1
    promised = summary.statistics if summary else None
    if promised is not None and promised.message_count != sum(counts.values()):
        raise BagError(
            f"{path}: holds {sum(counts.values())} messages, its statistics promise {promised.message_count}: "
            f"`dcmg bag repair {path}` keeps what is intact"
        )
    return schemas, channels, counts


def _records(path: Path, source: FileBytes, summary: SummarySection | None) -> Iterator[Frame | Messages]:
    for found in survey(source, summary):
        if isinstance(found, Fault):
            raise BagError(
                f"{path}: at byte {found.start}: {found.what}: `dcmg bag repair {path}` keeps what is intact"
            )
        if isinstance(found, Messages) and not found.table.whole:
            raise BagError(f"{path}: the chunk at byte {found.chunk.start} holds something besides records")
        yield found


def _message_fields(record: bytes) -> tuple[int, int, int, int]:
    if len(record) < MESSAGE_HEAD_LENGTH:
        raise BagError(f"a message record has {len(record)} bytes, expected {MESSAGE_HEAD_LENGTH} or more")
    number, sequence, log_time, publish_time = MESSAGE_HEAD.unpack(b"\0" * FRAME + record[:MESSAGE_HEAD_LENGTH])[2:]
    return number, sequence, log_time, publish_time


def _channel(record: Any, schemas: Mapping[int, Any], types: Mapping[str, str]) -> Channel:  # noqa: ANN401 - of mcap
    schema = schemas.get(record.schema_id)
    form, text = (schema.encoding, schema.data.decode("utf-8", "replace")) if schema else ("", "")
    type_name = schema.name if schema else types.get(record.topic, "")
    definition = Definition(
        type_name=_ros2_name(type_name) if form != "jsonschema" else type_name,
        form=form,
        text=text,
        encoding=record.message_encoding,
        type_hash=record.metadata.get("topic_type_hash", ""),
    )
    return Channel(
        topic=record.topic,
        definition=definition,
        latched=is_latched(record.metadata.get("offered_qos_profiles", "")),
    )


def _ros2_name(name: str) -> str:
    package, slash, base = name.partition("/")
    return f"{package}/msg/{base}" if slash and "/" not in base else name


def _attachments(source: FileBytes, summary: SummarySection | None) -> dict[str, bytes]:
    found = {}
    for start in summary.attachments if summary else ():
        frame = read_frame(source, start, source.size)
        if frame is not None and frame.opcode == Opcode.ATTACHMENT:
            found[frame.record.name] = frame.record.data
    return found
