"""What foreign files say about the wanted numbers, as arrays: bags of any origin, CSV and Parquet."""

from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader
from rosbags.interfaces import Connection

from bags.foreign.fields import Definitions, FieldPath
from bags.foreign.mapping import Mapping, Stamps
from bags.foreign.tables import is_table, read_columns
from bags.mcap.errors import BagError
from bags.mcap.typestore import typestore

HEADER = ("header", "std_msgs/msg/Header")
_SECOND_NS = 1_000_000_000
_REPORT_EVERY = 1000  # messages


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """The wanted numbers of one topic, or of a table, as they stand there: raw, unordered, ungridded.

    Attributes:
        name: Topic, or name of the table's file.
        fields: As the mapping names them, one a column.
        stamps_ns: Instants in the order of the file, shape (messages,).
        values: Shape (messages, fields); NaN where a value is missing.
    """

    name: str
    fields: tuple[str, ...]
    stamps_ns: NDArray[np.int64]
    values: NDArray[np.float64]


def read_recordings(
    source: Path,
    fields: Sequence[str],
    mapping: Mapping,
    progress: Callable[[int, int], None] = lambda _done, _all: None,
) -> list[Recording]:
    """Read the wanted numbers of a file or a bag.

    Args:
        source: A rosbag2 directory, an .mcap, .db3 or .bag file, a .csv or .parquet file.
        fields: Field paths, or columns of a table.
        mapping: Says which clock counts, and for a table its column of instants.
        progress: Called with how many messages are read and how many there are.

    Returns:
        One recording a topic, in the order in which the fields name them.

    Raises:
        BagError: The source cannot be read, lacks something, or holds something besides numbers there: one line.
    """
    if is_table(source):
        return [_read_table(source, fields, mapping)]
    if mapping.time is not None:
        raise BagError(f"{source}: is a bag, whose messages have stamps: expected no key time = {mapping.time.field!r}")
    paths = {text: _parsed(source, text) for text in fields}
    with open_foreign_bag(source) as reader:
        topics = list(dict.fromkeys(path.topic for path in paths.values()))
        connections = {topic: _connections(source, reader, topic) for topic in topics}
        definitions = definitions_of(reader)
        for path in paths.values():
            with _named(source):
                path.check(connections[path.topic][0].msgtype, definitions)
        types = {topic: connections[topic][0].msgtype for topic in topics}
        with _named(source):
            by_header = uses_header(types, definitions, mapping.stamps)
        readers = {topic: [path for path in paths.values() if path.topic == topic] for topic in topics}
        wanted = [one for topic in topics for one in connections[topic]]
        stamps, values = _messages(source, reader, wanted, readers, by_header=by_header, progress=progress)
    found = []
    for topic in topics:
        names = tuple(text for text, path in paths.items() if path.topic == topic)
        if not stamps[topic]:
            raise BagError(f"{source}: {topic} holds no message, expected at least one")
        times = np.array(stamps[topic], dtype=np.int64)
        if by_header and not times.any():
            raise BagError(f"{source}: every header stamp on {topic} is 0, expected instants: use stamps: recorded")
        numbers = np.array(values[topic]).reshape(len(times), len(names))
        found.append(Recording(name=topic, fields=names, stamps_ns=times, values=numbers))
    return found


@contextmanager
def open_foreign_bag(source: Path) -> Iterator[AnyReader]:
    """Open a bag of any origin: a rosbag2 directory (MCAP, sqlite3), one .mcap or .db3 file, or a ROS 1 .bag file.

    Raises:
        BagError: It cannot be read, here or inside the block.
    """
    if not source.exists():
        raise BagError(f"{source}: no such file or folder, expected a bag or a table")
    try:
        with AnyReader([source], default_typestore=typestore()) as reader:
            yield reader
    except BagError:
        raise
    except Exception as error:  # rosbags, sqlite and the decoders raise whatever damaged bytes lead to
        reason = " ".join(str(error).split()) or type(error).__name__
        raise BagError(f"{source}: cannot be read as a bag ({reason:.200})") from error


def definitions_of(reader: AnyReader) -> Definitions:
    """Fields of every message type that the bag defines, or of the standard ones when it defines none."""
    return {name: fields for name, (_, fields) in reader.typestore.fielddefs.items()}


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


def _messages(
    source: Path,
    reader: AnyReader,
    connections: Sequence[Connection],
    paths: dict[str, list[FieldPath]],
    *,
    by_header: bool,
    progress: Callable[[int, int], None],
) -> tuple[dict[str, "array[int]"], dict[str, "array[float]"]]:
    """Stamps and, one message after the other, values of each topic."""
    stamps = {topic: array("q") for topic in paths}
    values = {topic: array("d") for topic in paths}
    total = sum(one.msgcount for one in connections)
    for number, (connection, recorded_ns, data) in enumerate(reader.messages(connections)):
        message: Any = reader.deserialize(data, connection.msgtype)
        stamp = recorded_ns
        if by_header:
            stamp = stamp_of(message)
        with _named(source, recorded_ns):
            values[connection.topic].extend([path.read(message) for path in paths[connection.topic]])
        stamps[connection.topic].append(stamp)
        if number % _REPORT_EVERY == 0:
            progress(number, total)
    return stamps, values


def _read_table(source: Path, fields: Sequence[str], mapping: Mapping) -> Recording:
    wanted = list(dict.fromkeys([*fields, *([mapping.time.field] if mapping.time else [])]))
    table = read_columns(source, wanted)
    rows = len(next(iter(table.values())))
    if not rows:
        raise BagError(f"{source}: holds 0 rows, expected at least one")
    if mapping.time is None:
        if mapping.period_ns is None:
            raise BagError(f"{source}: found no key time, expected it or sampling_period_sec")
        stamps = np.arange(rows, dtype=np.int64) * mapping.period_ns
    else:
        instants = table[mapping.time.field] * (mapping.time.factor * _SECOND_NS) + mapping.time.offset * _SECOND_NS
        wrong = np.flatnonzero(~(np.abs(instants) < 2.0**62))
        if len(wrong):
            raise BagError(
                f"{source}: column {mapping.time.field} holds no instant in row {wrong[0]}, expected a number"
            )
        stamps = np.rint(instants).astype(np.int64)
    values = np.stack([table[name] for name in fields], axis=1)
    return Recording(name=source.name, fields=tuple(fields), stamps_ns=stamps, values=values)


def _connections(source: Path, reader: AnyReader, topic: str) -> list[Connection]:
    found = [one for one in reader.connections if one.topic == topic]
    if not found:
        names = ", ".join(sorted({one.topic for one in reader.connections})) or "none"
        raise BagError(f"{source}: holds no topic {topic}, expected one of {names:.300}")
    types = sorted({one.msgtype for one in found})
    if len(types) > 1:
        raise BagError(f"{source}: {topic} has messages of {' and '.join(types)}, expected one type")
    return found


def _parsed(source: Path, text: str) -> FieldPath:
    with _named(source):
        return FieldPath.parse(text)


@contextmanager
def _named(source: Path, recorded_ns: int | None = None) -> Iterator[None]:
    """Put the source, and the message's time, before the error of a field."""
    try:
        yield
    except BagError as error:
        when = "" if recorded_ns is None else f" (message recorded at {recorded_ns * 1e-9:.6f} s)"
        raise BagError(f"{source}: {error}{when}") from None
