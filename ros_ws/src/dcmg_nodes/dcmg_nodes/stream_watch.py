"""The guards of all streams into one DGU, fed with raw messages."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bags.wire.stream import arrival_of
from monitor.stream_guard import StreamGuard

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bags.wire.codecs import StepCodec
    from dcmg_nodes.intake import Others
    from monitor.stream_guard import Faults, StreamChange


class StreamWatch:
    """One guard a link. A message that is in order costs two comparisons.

    Args:
        codecs: of the received outputs.
    """

    def __init__(self, codecs: Sequence[StepCodec]) -> None:
        """Start without a fault."""
        self._codecs = codecs
        self._guards = [StreamGuard(codec.source) for codec in codecs]
        self._states: list[Faults] = [guard.init() for guard in self._guards]

    @property
    def faults(self) -> Sequence[Faults] | None:
        """Faults of each link's stream at the last step; None: none at all."""
        return self._states if any(self._states) else None

    def look(self, slot: int, step: int, own: bytes, others: Others | None) -> Sequence[StreamChange]:
        """Take what arrived on one link for a step; return what changed."""
        codec = self._codecs[slot]
        arrival = arrival_of(codec, own, known=True)
        if others is None and not self._states[slot] and arrival == (step, codec.source, True, True):
            return ()
        found = [arrival]
        if others is not None:
            seconds = [] if others.second is None else [others.second]
            found += [arrival_of(codec, data, known=False) for data in (*seconds, *others.strange)]
        self._states[slot], changes = self._guards[slot].step(self._states[slot], step, found)
        return changes
