"""What foreign files say about the wanted numbers, as arrays: bags of any origin, tables, flight logs."""

from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bags.foreign.fields import Definitions, FieldPath
from bags.foreign.mapping import Mapping
from bags.foreign.spill import Rows, SpilledRows
from bags.foreign.stamps import Stamps
from bags.foreign.table_recordings import read_table_recordings
from bags.foreign.tables import is_table
from bags.foreign.track import Recording
from bags.foreign.ulog import is_ulog, read_ulog
from bags.mcap.errors import BagError
from bags.sources.recorded import Known, Recorded, open_recorded
from bags.sources.source import Channel

HEADER = ("header", "std_msgs/msg/Header")
_SECOND_NS = 1_000_000_000
_REPORT_EVERY = 1000  # messages

Progress = Callable[[int, int], None]


def _silent(_done: int, _all: int) -> None:
    """Show nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Read:
    """What was read of a source.

    Attributes:
        recordings: One a topic, in the order in which the fields name them; of a table one, or one a column.
        notes: What a person should know.
    """

    recordings: tuple[Recording, ...]
    notes: tuple[str, ...] = ()


def read_recordings(
    source: Path, fields: Sequence[str], mapping: Mapping, known: Known | None = None, progress: Progress = _silent
) -> Read:
    """Read the wanted numbers of a file or a bag.

    Args:
        source: A rosbag2 directory, an .mcap, .db3 or .bag file, a table, a ULog.
        fields: Field paths, or columns of a table.
        mapping: Says which clock counts, and for a table its column of instants.
        known: Definitions for what a bag does not define itself.
        progress: Called with how many messages are read and how many there are.

    Raises:
        BagError: The source cannot be read, lacks something, or holds something besides numbers there: one line.
    """
    if is_table(source):
        recordings, notes = read_table_recordings(source, fields, mapping)
        return Read(recordings=recordings, notes=notes)
    if mapping.time is not None:
        raise BagError(f"{source}: is a bag, whose messages have stamps: expected no key time = {mapping.time.field!r}")
    if is_ulog(source):
        recordings, notes = read_ulog(source, fields)
        return Read(recordings=recordings, notes=notes)
    with open_recorded(source, known) as recorded:
        job = _BagJob.of(source, recorded, fields, mapping.stamps)
        found = job.read(recorded, progress)
        if found is None:  # every header says 0: nobody filled them in
            if mapping.stamps is Stamps.HEADER:
                raise BagError(f"{source}: every header stamp is 0, expected instants: use stamps: recorded")
            notes = (*recorded.notes, "every header stamp on a topic is 0: the times of recording count instead")
            job = _BagJob.of(source, recorded, fields, Stamps.RECORDED)
            return Read(recordings=job.read(recorded, progress) or (), notes=notes)
        return Read(recordings=found, notes=recorded.notes)


def uses_header(types: dict[str, str], definitions: Definitions, stamps: Stamps) -> bool:
    """Whether the headers say when messages were measured.

    Args:
        types: Message type of each mapped topic.
        definitions: Their fields.
        stamps: What the mapping says.

    Raises:
        BagError: It says headers and a type has none.
    """
    without = [topic for topic, type_name in types.items() if not has_header(type_name, definitions)]
    if stamps is Stamps.HEADER and without:
        raise BagError(
            f"stamps = 'header': {without[0]} is {types[without[0]]}, which has no header: expected 'recorded'"
        )
    return stamps is not Stamps.RECORDED and not without


def has_header(type_name: str, definitions: Definitions) -> bool:
    """Whether a message type has a std_msgs/Header called header."""
    name, wanted = HEADER
    return any(field == name and detail == wanted for field, (_, detail) in definitions.get(type_name, ()))


def stamp_of(message: Any) -> int:  # noqa: ANN401 - whatever has a header
    """Instant in the header of a message [ns]."""
    return int(message.header.stamp.sec * _SECOND_NS + message.header.stamp.nanosec)


@dataclass(frozen=True, slots=True, kw_only=True)
class _BagJob:
    """Which fields of which channels are read.

    Attributes:
        source: What to call it in messages.
        paths: Fields of each topic by the text that names them, topics in the order in which the fields name them.
        channels: Of these topics.
        by_header: Whether the headers say when a message was measured.
    """

    source: Path
    paths: dict[str, dict[str, FieldPath]]
    channels: tuple[Channel, ...]
    by_header: bool

    @classmethod
    def of(cls, source: Path, recorded: Recorded, fields: Sequence[str], stamps: Stamps) -> "_BagJob":
        topics = recorded.topics
        paths: dict[str, dict[str, FieldPath]] = {}
        with _named(source):
            for text in fields:
                path = FieldPath.parse(text, topics)
                paths.setdefault(path.topic, {})[text] = path
        for topic in paths:
            if topic not in topics:
                raise BagError(f"{source}: holds no topic {topic}, expected one of {', '.join(topics) or 'none':.300}")
            reason = recorded.unreadable(topic)
            if reason:
                raise BagError(f"{source}: {topic} cannot be read: {reason}")
        channels = tuple(one for topic in paths for one in topics[topic] if not isinstance(recorded.decoders[one], str))
        headers = []
        with _named(source):
            for one in channels:
                decoder = recorded.decoders[one]
                if not isinstance(decoder, str):
                    for path in paths[one.topic].values():
                        path.check(decoder.type_name, decoder.fields)
                    headers.append(uses_header({one.topic: decoder.type_name}, decoder.fields, stamps))
        return cls(source=source, paths=paths, channels=channels, by_header=all(headers))

    def read(self, recorded: Recorded, progress: Progress) -> tuple[Recording, ...] | None:
        """Go through the messages; None when every header stamp of a topic is 0."""
        stamps = {topic: array("q") for topic in self.paths}
        values = {topic: SpilledRows(len(paths)) for topic, paths in self.paths.items()}
        wanted = {topic: list(paths.values()) for topic, paths in self.paths.items()}
        readers = {one: found.read for one in self.channels if not isinstance(found := recorded.decoders[one], str)}
        total = sum(recorded.channels[one] for one in self.channels)
        for number, (channel, recorded_ns, data) in enumerate(recorded.messages(self.channels)):
            topic = channel.topic
            with _named(self.source, topic, recorded_ns):
                message = readers[channel](data)
                values[topic].append([path.read(message) for path in wanted[topic]])
            stamps[topic].append(stamp_of(message) if self.by_header else recorded_ns)
            if number % _REPORT_EVERY == 0:
                progress(number, total)
        return self._recordings(stamps, values)

    def _recordings(
        self, stamps: dict[str, "array[int]"], values: dict[str, SpilledRows]
    ) -> tuple[Recording, ...] | None:
        found = []
        for topic, paths in self.paths.items():
            if not stamps[topic]:
                raise BagError(f"{self.source}: {topic} holds no message, expected at least one")
            times = np.frombuffer(stamps[topic], dtype=np.int64)  # no copy: of an hour that is 60 MB
            if self.by_header and not times.any():
                return None
            rows: Rows = values[topic]
            found.append(Recording(name=topic, fields=tuple(paths), stamps_ns=times, values=rows))
        return tuple(found)


class _named:  # noqa: N801 - used like a function, and entered once a message: contextlib would double the time
    """Put the source, and the message, before the error of a field."""

    __slots__ = ("_source", "_time_ns", "_topic")

    def __init__(self, source: Path, topic: str = "", time_ns: int = 0) -> None:
        self._source, self._topic, self._time_ns = source, topic, time_ns

    def __enter__(self) -> None:
        """Nothing to do."""

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        if isinstance(error, BagError):
            when = f" ({self._topic}, recorded at {self._time_ns * 1e-9:.6f} s)" if self._topic else ""
            raise BagError(f"{self._source}: {error}{when}") from None
