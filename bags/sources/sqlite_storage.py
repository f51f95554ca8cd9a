"""One sqlite3 file of rosbag2, as sqlite itself would read it: with its write-ahead log or journal, on a copy."""

import shutil
import sqlite3
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from bags.mcap.definitions import Definition
from bags.mcap.errors import BagError
from bags.sources.latching import is_latched
from bags.sources.source import Channel, RawMessage

_BESIDE = ("-wal", "-journal")  # what sqlite has not yet taken into the file, or has to take back out of it
_ROWS = 500
_TOPICS = ("id", "name", "type", "serialization_format", "offered_qos_profiles", "type_description_hash")


@dataclass(frozen=True, slots=True, kw_only=True)
class SqliteStorage:
    """A sqlite3 file opened for reading.

    Attributes:
        path: The file.
        channels: Its channels with the number of messages on each.
        attachments: None: there are no such things.
        notes: What a person should know.
    """

    path: Path
    channels: Mapping[Channel, int]
    attachments: Mapping[str, bytes]
    notes: tuple[str, ...]
    _connection: sqlite3.Connection
    _copy: "TemporaryDirectory[str] | None"
    _by_id: Mapping[int, Channel]

    def messages(self, wanted: Collection[Channel]) -> Iterator[RawMessage]:
        """Messages of some channels by stamp.

        Raises:
            BagError: The file is damaged.
        """
        numbers = [number for number, one in self._by_id.items() if one in wanted]
        marks = ",".join("?" * len(numbers))
        query = f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({marks}) ORDER BY timestamp, id"  # noqa: S608 - question marks only
        with _readable(self.path):
            cursor = self._connection.execute(query, numbers)
            while rows := cursor.fetchmany(_ROWS):
                for number, time_ns, data in rows:
                    yield RawMessage(self._by_id[number], time_ns, data)

    def close(self) -> None:
        """Close the file; remove the copy, if there is one."""
        self._connection.close()
        if self._copy is not None:
            self._copy.cleanup()


def open_sqlite(path: Path) -> SqliteStorage:
    """Open a sqlite3 file of rosbag2.

    Args:
        path: The file. It is not changed: where sqlite would have to, a copy is read.

    Raises:
        BagError: It is damaged, or no recording of rosbag2.
    """
    beside = [path.with_name(path.name + end) for end in _BESIDE]
    beside = [one for one in beside if one.is_file() and one.stat().st_size]
    copy = TemporaryDirectory(prefix="dcmg_") if beside else None
    connection: sqlite3.Connection | None = None
    try:
        with _readable(path):
            connection = _connect(path, beside, copy)
            by_id = _channels(connection)
            counts = dict(connection.execute("SELECT topic_id, count(*) FROM messages GROUP BY topic_id"))
        channels = _counted(path, by_id, counts)
    except BaseException:
        if connection is not None:
            connection.close()
        if copy is not None:
            copy.cleanup()
        raise
    return SqliteStorage(
        path=path,
        channels=channels,
        attachments={},
        notes=tuple(f"{path.name}: what stands in {one.name} was read too, on a copy" for one in beside),
        _connection=connection,
        _copy=copy,
        _by_id=by_id,
    )


def _counted(path: Path, by_id: Mapping[int, Channel], counts: Mapping[int, int]) -> dict[Channel, int]:
    """Number of messages of each channel."""
    stray = sum(count for number, count in counts.items() if number not in by_id)
    if stray:
        raise BagError(f"{path}: holds {stray} messages of topics that it does not describe, expected none")
    channels: dict[Channel, int] = dict.fromkeys(by_id.values(), 0)
    for number, channel in by_id.items():
        channels[channel] += counts.get(number, 0)
    return channels


def _connect(path: Path, beside: list[Path], copy: "TemporaryDirectory[str] | None") -> sqlite3.Connection:
    if copy is None:
        return sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)
    there = Path(copy.name) / path.name
    for one in (path, *beside):
        shutil.copyfile(one, there.with_name(one.name))
    return sqlite3.connect(f"{there.as_uri()}?mode=rw", uri=True)


def _channels(connection: sqlite3.Connection) -> dict[int, Channel]:
    """The topics by id; what older versions do not store is empty."""
    there = _columns(connection, "topics")
    if not {"id", "name", "type"} <= there or not {"topic_id", "timestamp", "data"} <= _columns(connection, "messages"):
        raise BagError("has no tables topics and messages, expected those of rosbag2")
    named = ", ".join(name if name in there else "''" for name in _TOPICS)
    definitions = _definitions(connection)
    found = {}
    for number, topic, type_name, encoding, profiles, type_hash in connection.execute(f"SELECT {named} FROM topics"):  # noqa: S608 - our own names
        form, text = definitions.get((type_name, type_hash)) or definitions.get((type_name, "")) or ("", "")
        definition = Definition(
            type_name=type_name, form=form, text=text, encoding=encoding or "cdr", type_hash=type_hash or ""
        )
        found[number] = Channel(topic=topic, definition=definition, latched=is_latched(profiles))
    return found


def _definitions(connection: sqlite3.Connection) -> dict[tuple[str, str], tuple[str, str]]:
    """Form and text of each type and type hash; without a hash: when a type has one definition only."""
    if "encoded_message_definition" not in _columns(connection, "message_definitions"):
        return {}
    found: dict[tuple[str, str], tuple[str, str]] = {}
    query = "SELECT topic_type, encoding, encoded_message_definition, type_description_hash FROM message_definitions"
    several: set[str] = set()
    for type_name, form, text, type_hash in connection.execute(query):
        if not text or form not in {"ros2msg", "ros2idl"}:
            continue
        if found.get((type_name, ""), (form, text)) != (form, text):
            several.add(type_name)
        found[type_name, ""] = form, text
        if type_hash:
            found[type_name, type_hash] = form, text
    return {key: value for key, value in found.items() if key[1] or key[0] not in several}


def _columns(connection: sqlite3.Connection, table: str) -> set[str]:
    return {str(row[1]) for row in connection.execute(f"PRAGMA table_info({table})")}


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Name the file before whatever sqlite makes of it."""
    try:
        yield
    except BagError as error:
        raise BagError(f"{path}: {error}") from None
    except (sqlite3.Error, OSError, TypeError, ValueError) as error:
        raise BagError(
            f"{path}: damaged ({' '.join(str(error).split())}): `sqlite3 {path} .recover` keeps what is intact"
        ) from error
