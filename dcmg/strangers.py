"""What others said on the topics of a run, and what a person is told of it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from dcmg.tabular import tabulate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.table import Table

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
    groups: dict[tuple[str, ...], list[StrangeTopic]] = {}
    for topic in topics:
        groups.setdefault(topic.publishers, []).append(topic)
    cells = []
    for publishers, rows in groups.items():
        names = ", ".join(row.topic for row in rows[:_NAMED])
        more = f" and {len(rows) - _NAMED} more" if rows[_NAMED:] else ""
        who = ", ".join(publishers) or "unknown"
        cells.append((who, names + more, str(sum(row.messages for row in rows))))
    counts = "messages set aside"
    return tabulate(("stranger", "on topic", counts), cells, numbers={counts}, styles=["yellow"] * len(cells))
