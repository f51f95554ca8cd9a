"""What a foreign bag or table holds, for whoever writes a mapping."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np
from rosbags.highlevel import AnyReader

from bags.foreign.fields import numeric_fields
from bags.foreign.recordings import definitions_of, has_header, open_foreign_bag, stamp_of
from bags.foreign.regularity import Regularity, regularity
from bags.foreign.tables import all_columns, is_table


@final
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
    """

    name: str
    type_name: str
    messages: int
    fields: tuple[str, ...]
    regularity: Regularity | None
    clock: str

    def document(self) -> dict[str, Any]:
        """For a JSON document."""
        return {
            "name": self.name,
            "type": self.type_name,
            "messages": self.messages,
            "fields": list(self.fields),
            "clock": self.clock,
            "sampling": self.regularity.document() if self.regularity else None,
        }


def describe_source(source: Path) -> list[Described]:
    """Go through a bag or table once.

    Raises:
        BagError: It cannot be read.
    """
    if is_table(source):
        columns = all_columns(source)
        rows = len(next(iter(columns.values()), ()))
        names = tuple(columns)
        return [
            Described(name=source.name, type_name="table", messages=rows, fields=names, regularity=None, clock="column")
        ]
    with open_foreign_bag(source) as reader:
        return [_described(reader, topic) for topic in sorted({one.topic for one in reader.connections})]


def _described(reader: AnyReader, topic: str) -> Described:
    definitions = definitions_of(reader)
    connections = [one for one in reader.connections if one.topic == topic]
    type_name = connections[0].msgtype
    by_header = has_header(type_name, definitions)
    stamps = []
    for connection, recorded_ns, data in reader.messages(connections):
        stamp = recorded_ns
        if by_header:
            message: Any = reader.deserialize(data, connection.msgtype)
            stamp = stamp_of(message)
        stamps.append(stamp)
    nothing = np.zeros((len(stamps), 0))
    return Described(
        name=topic,
        type_name=type_name,
        messages=len(stamps),
        fields=tuple(topic + path for path in numeric_fields(type_name, definitions)),
        regularity=regularity(topic, np.array(stamps, dtype=np.int64), nothing) if stamps else None,
        clock="header" if by_header else "recorded",
    )
