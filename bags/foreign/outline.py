"""What a foreign bag or table holds, for whoever writes a mapping."""

from array import array
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bags.foreign.columns import ColumnKind, Table
from bags.foreign.fields import numeric_fields
from bags.foreign.recordings import has_header, stamp_of
from bags.foreign.regularity import Regularity, regularity
from bags.foreign.tables import is_table, open_table
from bags.foreign.ulog import is_ulog, ulog_topics
from bags.mcap.definitions import Decoder
from bags.mcap.errors import BagError
from bags.sources.recorded import Known, Recorded, open_recorded
from bags.sources.source import Channel, RawMessage

_MICROSECOND_NS = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Described:
    """One topic, or a table.

    Attributes:
        name: Topic, or the table's file.
        type_name: Message type, `table` for a table.
        messages: How many, or rows.
        fields: Paths of its numbers, or columns.
        regularity: What its stamps say; None: it has none.
        clock: `header` or `recorded`.
        times: Columns of a table that hold instants.
        texts: Columns that hold text.
        units: Units of columns as the file states them.
        unreadable: Why it cannot be read, "" when it can.
    """

    name: str
    type_name: str
    messages: int
    fields: tuple[str, ...]
    regularity: Regularity | None
    clock: str
    times: tuple[str, ...] = ()
    texts: tuple[str, ...] = ()
    units: tuple[tuple[str, str], ...] = ()
    unreadable: str = ""

    def document(self) -> dict[str, Any]:
        """For a JSON document."""
        return {
            "name": self.name,
            "type": self.type_name,
            "messages": self.messages,
            "fields": list(self.fields),
            "clock": self.clock,
            "sampling": self.regularity.document() if self.regularity else None,
            "times": list(self.times),
            "texts": list(self.texts),
            "units": dict(self.units),
            "unreadable": self.unreadable,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Outline:
    """What a source holds.

    Attributes:
        topics: Its topics, or the one table.
        notes: What a person should know.
    """

    topics: tuple[Described, ...]
    notes: tuple[str, ...]

    @property
    def left_out(self) -> tuple[Described, ...]:
        """Topics that hold messages and cannot be read."""
        return tuple(one for one in self.topics if one.unreadable and one.messages)


def describe_source(source: Path | str, known: Known | None = None) -> Outline:
    """Go through a bag or table once.

    Raises:
        BagError: It cannot be read.
    """
    source = Path(source)
    if is_table(source):
        table = open_table(source)
        return Outline(topics=(_table(table),), notes=tuple(table.notes))
    if is_ulog(source):
        topics, notes = ulog_topics(source)
        return Outline(topics=tuple(_logged(name, topics[name]) for name in sorted(topics)), notes=notes)
    with open_recorded(source, known) as recorded:
        return Outline(topics=_described(recorded), notes=recorded.notes)


def _table(table: Table) -> Described:
    def named(kind: ColumnKind) -> tuple[str, ...]:
        return tuple(one.name for one in table.columns if one.kind is kind)

    rows = table.rows
    usable = [one.name for one in table.columns if [other.name for other in table.columns].count(one.name) == 1]
    if rows < 0 and usable:
        try:
            rows = sum(len(next(iter(part.values()))) for part in table.parts(usable[:1]))
        except BagError:
            rows = -1
    return Described(
        name=table.file.name,
        type_name="table",
        messages=rows,
        fields=named(ColumnKind.NUMBER),
        regularity=None,
        clock="column",
        times=named(ColumnKind.TIME),
        texts=named(ColumnKind.TEXT),
        units=tuple((one.name, one.unit) for one in table.columns if one.unit),
    )


def _logged(name: str, data: dict[str, Any]) -> Described:
    stamps = np.asarray(data["timestamp"], dtype=np.int64) * _MICROSECOND_NS
    return Described(
        name=name,
        type_name="ULog",
        messages=len(stamps),
        fields=tuple(f"{name}.{one}" for one in data if one != "timestamp"),
        regularity=regularity(name, stamps, None) if len(stamps) else None,
        clock="recorded",
    )


@dataclass(slots=True, kw_only=True)
class _Look:
    """One topic while the recording is gone through.

    Attributes:
        topic: Its name.
        channels: Its channels.
        decoders: What reads them.
        reason: Why it cannot be read.
        headed: Whether every channel has a header.
        stamps: Times of recording.
        headers: Stamps of the headers.
        seen: Channels of which a message was read.
    """

    topic: str
    channels: list[Channel]
    decoders: dict[Channel, Decoder]
    reason: str
    headed: bool
    stamps: "array[int]" = field(default_factory=lambda: array("q"))
    headers: "array[int]" = field(default_factory=lambda: array("q"))
    seen: set[Channel] = field(default_factory=set)

    @classmethod
    def at(cls, recorded: Recorded, topic: str) -> "_Look":
        """Before the first message."""
        channels = recorded.topics[topic]
        decoders = {one: found for one in channels if not isinstance(found := recorded.decoders[one], str)}
        reason = recorded.unreadable(topic)
        headed = not reason and all(has_header(one.type_name, one.fields) for one in decoders.values())
        return cls(topic=topic, channels=channels, decoders=decoders, reason=reason, headed=headed)

    def take(self, message: RawMessage) -> None:
        """Take one message; every one is counted, whether or not it can be read."""
        self.stamps.append(message.time_ns)
        if self.reason or not (self.headed or message.channel not in self.seen):
            return
        self.seen.add(message.channel)
        try:
            found = self.decoders[message.channel].read(message.data)
        except BagError as error:
            self.reason, self.headed = str(error), False
            return
        if self.headed:
            self.headers.append(stamp_of(found))

    def described(self) -> Described:
        """What was found."""
        fields: dict[str, None] = {}
        for decoder in () if self.reason else self.decoders.values():
            fields |= dict.fromkeys(self.topic + path for path in numeric_fields(decoder.type_name, decoder.fields))
        by_header = self.headed and any(self.headers)
        instants = np.array(self.headers if by_header else self.stamps, dtype=np.int64)
        silent = self.headed and not by_header and len(instants)
        return Described(
            name=self.topic,
            type_name=" and ".join(dict.fromkeys(one.definition.type_name for one in self.channels)),
            messages=len(self.stamps),
            fields=tuple(fields),
            regularity=regularity(self.topic, instants, None) if len(instants) else None,
            clock="header" if by_header else "recorded, every header is 0" if silent else "recorded",
            unreadable=self.reason,
        )


def _described(recorded: Recorded) -> tuple[Described, ...]:
    """Every topic, in one pass."""
    looks = {topic: _Look.at(recorded, topic) for topic in recorded.topics}
    for message in recorded.messages(recorded.channels):
        looks[message.channel.topic].take(message)
    return tuple(one.described() for one in looks.values())
