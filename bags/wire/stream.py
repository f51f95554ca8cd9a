"""Faults of the streams into a DGU: their codec, and where a run's messages show one."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bags.mcap.errors import BagError
from bags.mcap.topic import Topic
from bags.wire.codecs import StepCodec
from bags.wire.records import StreamRecord
from bags.wire.row import Spot
from bags.wire.varying import deserialize, fields_of, header_of, record_of, serialize
from dgu_sim.grid import Link
from monitor.stream_guard import Arrival, Faults, StreamChange, StreamFault, StreamGuard


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamCodec:
    """`dcmg_msgs/msg/StreamEvent` on /dgu_j/stream."""

    topic: Topic
    period_ns: int
    monitor: int
    frame: str

    @classmethod
    def at(cls, spot: Spot) -> "StreamCodec":
        """The codec of a row at a place."""
        return cls(topic=spot.topic, period_ns=spot.period_ns, monitor=spot.place.target, frame=spot.frame)

    def encode(self, step: int, source: int, change: StreamChange) -> bytes:
        """Bytes of a fault that appears or is over at step k on the link from `source`."""
        record = StreamRecord(
            step=step,
            source=source,
            monitor=self.monitor,
            kind=change.kind.value,
            active=change.active,
            detail=change.detail,
        )
        header = header_of(step, self.period_ns, self.frame)
        return serialize(self.topic.type_name, header=header, **fields_of(record))

    def decode(self, data: bytes) -> StreamRecord:
        """The record.

        Raises:
            BagError: A fault that does not exist.
        """
        message = deserialize(self.topic.type_name, data)
        if message.kind not in set(StreamFault):
            raise BagError(f"{self.topic.name}: kind {message.kind!r}, expected one of {', '.join(StreamFault)}")
        return record_of(StreamRecord, message)


def lies(faults: Faults) -> bool:
    """Whether faults say that somebody else speaks on a link: one that only loses samples does not lie."""
    return any(fault is not StreamFault.MISSING for fault in faults)


@dataclass(slots=True)
class Spoofed:
    """The links whose streams lie at each row of a recorded run, window by window."""

    links: Sequence[Link]
    _active: set[tuple[int, str]] = field(default_factory=set)

    def rows(self, records: Sequence[StreamRecord], first_step: int, steps: int) -> dict[int, list[int]]:
        """Positions of such links by row; `records` of these steps in order of time."""
        changes: dict[int, list[StreamRecord]] = {}
        for one in records:
            if one.kind != StreamFault.MISSING:
                changes.setdefault(one.step - first_step, []).append(one)
        found: dict[int, list[int]] = {}
        for row in range(steps) if changes or self._active else ():
            for one in changes.get(row, ()):
                entry = (self.links.index(Link(one.source, one.monitor)), one.kind)
                (self._active.add if one.active else self._active.discard)(entry)
            if self._active:
                found[row] = sorted({position for position, _ in self._active})
        return found


def arrival_of(codec: StepCodec, data: bytes, *, known: bool) -> Arrival:
    """What the guard of a stream is told of one message; one that is no output claims step 0 of DGU 0."""
    try:
        if len(data) == codec.layout.size:
            return Arrival(*codec.claims(data), known)
        message = deserialize(codec.topic.type_name, data)  # another frame_id, from somebody else
    except BagError:
        return Arrival(0, 0, delivered=False, known=known)
    return Arrival(message.step, message.source, message.delivered, known)


def claimed_step(codec: StepCodec, data: bytes) -> int:
    """The step that a message claims to be of."""
    return arrival_of(codec, data, known=False).step


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkFaults:
    """Faults of every link's stream at one step, in the order of the links."""

    active: tuple[Faults, ...]

    @classmethod
    def none(cls, links: Sequence[Link]) -> "LinkFaults":
        """Before step 0."""
        return cls(active=((),) * len(links))


def stream_changes(
    before: LinkFaults,
    links: Sequence[Link],
    delivered: NDArray[np.bool_],
    doubled: Sequence[tuple[int, int]],
    first_step: int = 0,
) -> tuple[LinkFaults, list[tuple[int, int, StreamChange]]]:
    """What the guards of all links say about consecutive steps.

    The link itself always delivers one message of each step, in order, from its publisher; only the steps at which it
    lost the sample or another publisher spoke, and those behind them, can change anything.

    Args:
        before: Faults at the step before the first.
        links: The links.
        delivered: What the link's own messages say, shape (steps, links).
        doubled: Row and link of each message of a second publisher, which claims the same step and source.
        first_step: Step of the first row.

    Returns:
        The faults at the last step, and row, link and change in the order in which they are told.
    """
    found: list[tuple[int, int, StreamChange]] = []
    active = list(before.active)
    twice = set(doubled)
    for position, link in enumerate(links):
        guard = StreamGuard(link.source)
        for row in _suspects(position, delivered, doubled, waits=bool(active[position])):
            k = first_step + row
            arrivals = [Arrival(k, link.source, delivered=bool(delivered[row, position]))]
            if (row, position) in twice:
                arrivals.append(Arrival(k, link.source, known=False))
            active[position], changes = guard.step(active[position], k, arrivals)
            found += [(row, position, change) for change in changes]
    found.sort(key=lambda one: (one[0], links[one[1]].target, links[one[1]].source))
    return LinkFaults(active=tuple(active)), found


def _suspects(
    position: int, delivered: NDArray[np.bool_], doubled: Sequence[tuple[int, int]], *, waits: bool
) -> Iterator[int]:
    """Rows at which the faults of one link can change, ascending."""
    rows = set(np.flatnonzero(~delivered[:, position]).tolist()) | {row for row, link in doubled if link == position}
    rows |= {row + 1 for row in rows} | ({0} if waits else set())
    return iter(sorted(row for row in rows if row < len(delivered)))
