"""What a run's gate has heard from others, as the supervisor learns of it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from rich.markup import escape

from dcmg.strangers import StrangeTopic
from dcmg_nodes.options import STRANGERS_SUMMARY

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

_NAMED = 4  # topics that a line names; it counts the others


class Strangers:
    """Reads the gate's summary again when it has changed, and names everybody once.

    Args:
        folder: where the gate keeps it.
        say: shows a line of rich markup.
    """

    def __init__(self, folder: Path, say: Callable[[str], None]) -> None:
        """Start with nobody."""
        self._path, self._say = folder / STRANGERS_SUMMARY, say
        self._read_ns = 0
        self._named: set[str] = set()
        self.topics: Sequence[StrangeTopic] = ()

    def look(self) -> None:
        """Name whoever is new."""
        try:
            written_ns = self._path.stat().st_mtime_ns
        except OSError:
            return  # nobody yet
        if written_ns == self._read_ns:
            return
        self._read_ns = written_ns
        heard = json.loads(self._path.read_text())
        self.topics = [
            StrangeTopic(topic=topic, publishers=tuple(said["publishers"]), messages=said["messages"])
            for topic, said in heard.items()
        ]
        found: dict[str, list[str]] = {}
        for row in self.topics:
            for publisher in row.publishers:
                found.setdefault(publisher, []).append(row.topic)
        for publisher, topics in found.items():
            if publisher not in self._named:
                self._named.add(publisher)
                names = ", ".join(topics[:_NAMED]) + (f" and {len(topics) - _NAMED} more" if topics[_NAMED:] else "")
                self._say(f"[yellow]stranger: {escape(publisher)} publishes on {names}[/]: set aside, not of this run")
