"""What others said on the topics of a run, and what a person is told of it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from rich.markup import escape
from rich.table import Table

if TYPE_CHECKING:
    from collections.abc import Sequence

_NAMED = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class StrangeTopic:
    """One topic of a run on which somebody published who does not belong to it.

    Attributes:
        topic: its name.
        publishers: full names of the nodes; of a type that is not the topic's, with it.
        messages: how many of their messages were heard, and set aside.
    """

    topic: str
    publishers: tuple[str, ...]
    messages: int


def strangers_document(topics: Sequence[StrangeTopic]) -> list[dict[str, object]]:
    """Return the part of the JSON document."""
    return [asdict(topic) for topic in topics]


def strangers_table(topics: Sequence[StrangeTopic]) -> Table:
    """Return a row for each group of publishers that speak on the same topics."""
    table = Table("stranger", "on topic", "messages set aside")
    table.columns[-1].justify = "right"
    for column in table.columns:
        column.overflow = "fold"
    groups: dict[tuple[str, ...], list[StrangeTopic]] = {}
    for topic in topics:
        groups.setdefault(topic.publishers, []).append(topic)
    for publishers, rows in groups.items():
        names = ", ".join(row.topic for row in rows[:_NAMED])
        more = f" and {len(rows) - _NAMED} more" if rows[_NAMED:] else ""
        who = ", ".join(publishers) or "unknown"
        table.add_row(escape(who), escape(names + more), str(sum(row.messages for row in rows)), style="yellow")
    return table
