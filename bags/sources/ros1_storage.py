"""One ROS 1 bag file, through the `rosbags` library."""

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbags.interfaces import ConnectionExtRosbag1
from rosbags.rosbag1 import Reader

from bags.mcap.definitions import ROS1, Definition
from bags.mcap.errors import BagError
from bags.sources.source import Channel, RawMessage


@dataclass(frozen=True, slots=True, kw_only=True)
class Ros1Storage:
    """A ROS 1 bag file opened for reading.

    Attributes:
        path: The file.
        channels: Its channels with the number of messages that its index counts.
        attachments: None: there are no such things.
    """

    path: Path
    channels: Mapping[Channel, int]
    attachments: Mapping[str, bytes]
    _reader: Reader
    _connections: tuple[tuple[Any, Channel], ...]

    def messages(self, wanted: Collection[Channel]) -> Iterator[RawMessage]:
        """Messages of some channels by stamp.

        Raises:
            BagError: The file is damaged.
        """
        chosen = {one.id: channel for one, channel in self._connections if channel in wanted}
        connections = [one for one, _ in self._connections if one.id in chosen]
        if not connections:
            return
        with _readable(self.path):
            for connection, time_ns, data in self._reader.messages(connections=connections):
                yield RawMessage(chosen[connection.id], time_ns, bytes(data))

    def close(self) -> None:
        """Close the file."""
        self._reader.close()


def open_ros1(path: Path) -> Ros1Storage:
    """Open a ROS 1 bag file.

    Raises:
        BagError: It is damaged, or was not closed.
    """
    with _readable(path):
        reader = Reader(path)
        reader.open()
    connections = tuple((one, _channel(one)) for one in reader.connections)
    counts: dict[Channel, int] = dict.fromkeys((channel for _, channel in connections), 0)
    for one, channel in connections:
        counts[channel] += one.msgcount
    return Ros1Storage(path=path, channels=counts, attachments={}, _reader=reader, _connections=connections)


def _channel(connection: Any) -> Channel:  # noqa: ANN401 - of rosbags
    definition = Definition(
        type_name=connection.msgtype, form="ros1msg", text=connection.msgdef.data, encoding=ROS1, type_hash=""
    )
    ext = connection.ext
    latched = isinstance(ext, ConnectionExtRosbag1) and bool(ext.latching)
    return Channel(topic=connection.topic, definition=definition, latched=latched)


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    try:
        yield
    except BagError:
        raise
    except Exception as error:  # rosbags raises whatever damaged bytes lead to
        reason = " ".join(str(error).split()) or type(error).__name__
        raise BagError(f"{path}: cannot be read as a ROS 1 bag ({reason:.200}): `rosbag reindex` may help") from error
