"""What a bag of any origin offers for playing: its topics, and its messages one after the other."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol, final

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.interfaces import ConnectionExtRosbag2, QosDurability

from bags.mcap.chunk import MESSAGE_HEAD, MESSAGE_HEAD_LENGTH
from bags.mcap.container import ChunkView, Container, open_container, readable
from bags.mcap.errors import BagError
from bags.mcap.frames import FRAME
from bags.mcap.yaml_text import load

CDR = "cdr"
_LATCHED = (1, "transient_local")  # by number in older bags


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlayedTopic:
    """A topic of a bag.

    Attributes:
        name: Its ROS name.
        type_name: Full message type name.
        type_hash: RIHS01 hash of its type, "" when the bag holds none.
        encoding: Of its messages; only `cdr` can be published.
        latched: Whether a late subscriber got what was published before.
        count: Number of messages.
    """

    name: str
    type_name: str
    type_hash: str
    encoding: str
    latched: bool
    count: int


class PlayedMessage(NamedTuple):
    """One message of a bag."""

    time_ns: int
    topic: str
    data: bytes


class Source(Protocol):
    """A bag opened for playing; holds no message in memory."""

    @property
    def topics(self) -> Mapping[str, PlayedTopic]:
        """Its topics by name."""

    @property
    def start_ns(self) -> int:
        """Earliest stamp [ns]."""

    @property
    def end_ns(self) -> int:
        """Latest stamp [ns]."""

    @property
    def attachments(self) -> Mapping[str, bytes]:
        """Documents in the bag by name."""

    def messages(self, topics: Collection[str], start_ns: int, end_ns: int) -> Iterator[PlayedMessage]:
        """Messages with stamps in [start_ns, end_ns], in the order of the bag."""


def open_source(path: Path) -> Source:
    """Open a bag for playing: ours, or one by any other program that writes rosbag2 (MCAP or sqlite3).

    Args:
        path: The bag's directory.

    Raises:
        BagError: Not a bag, not closed, or damaged: one line.
    """
    try:
        container = open_container(path)
    except BagError as error:
        if not any(path.glob("*.db3*")):
            raise
        return _by_rosbags(path, error)
    counted = sum(container.counts.values())
    if counted and not any(len(summary.chunks) for _, summary in container.files):
        return _by_rosbags(path, BagError(f"{path}: its messages are in no chunks"))
    return _ChunkSource.of(container)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _ChunkSource:
    """MCAP files, read a chunk at a time."""

    container: Container
    topics: Mapping[str, PlayedTopic]
    start_ns: int
    end_ns: int

    @classmethod
    def of(cls, container: Container) -> "_ChunkSource":
        counts, types = container.counts, container.topics
        channels = {one.topic: one for _, summary in container.files for one in summary.channels.values()}
        topics = {
            name: PlayedTopic(
                name=name,
                type_name=types[name],
                type_hash=channel.metadata.get("topic_type_hash", ""),
                encoding=channel.message_encoding,
                latched=_is_latched(channel),
                count=counts[name],
            )
            for name, channel in channels.items()
        }
        spans = [one.statistics for _, one in container.files if one.statistics and one.statistics.message_count]
        return cls(
            container=container,
            topics=topics,
            start_ns=min((one.message_start_time for one in spans), default=0),
            end_ns=max((one.message_end_time for one in spans), default=0),
        )

    @property
    def attachments(self) -> Mapping[str, bytes]:
        """Documents in the bag by name."""
        return self.container.attachments

    def messages(self, topics: Collection[str], start_ns: int, end_ns: int) -> Iterator[PlayedMessage]:
        """Messages with stamps in [start_ns, end_ns], in the order of the files."""
        for channels, chunk in self.container.chunks(topics, (start_ns, end_ns)):
            with readable(self.container.path):
                found = _in_chunk(channels, chunk)
            for message in found:
                if start_ns <= message.time_ns <= end_ns:
                    yield message


def _in_chunk(channels: Mapping[int, Channel], chunk: ChunkView) -> list[PlayedMessage]:
    """The messages of a chunk in the order of the file.

    Raises:
        BagError: An offset points to something else.
    """
    if not chunk.offsets:
        return []
    offsets = np.sort(np.concatenate(list(chunk.offsets.values())))
    unpack, data = MESSAGE_HEAD.unpack_from, chunk.data.data
    names = {number: channel.topic for number, channel in channels.items()}
    found = []
    for at in offsets.tolist():
        opcode, length, channel_id, _, time_ns, _ = unpack(data, at)
        end = at + FRAME + length
        if opcode != Opcode.MESSAGE or length < MESSAGE_HEAD_LENGTH or end > len(data):
            raise BagError(f"the message index points to {at}, where no message is")
        found.append(PlayedMessage(time_ns, names[channel_id], bytes(data[at + MESSAGE_HEAD.size : end])))
    return found


def _is_latched(channel: Channel) -> bool:
    text = channel.metadata.get("offered_qos_profiles", "")
    profiles = load(text) if text else None
    if not isinstance(profiles, list):
        return False
    return any(isinstance(one, dict) and one.get("durability") in _LATCHED for one in profiles)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _RosbagsSource:
    """Storage that only the `rosbags` library reads: sqlite3, and MCAP files without chunks."""

    path: Path
    topics: Mapping[str, PlayedTopic]
    start_ns: int
    end_ns: int

    @property
    def attachments(self) -> Mapping[str, bytes]:
        """None: rosbags does not read them."""
        return {}

    def messages(self, topics: Collection[str], start_ns: int, end_ns: int) -> Iterator[PlayedMessage]:
        """Messages with stamps in [start_ns, end_ns], by stamp."""
        with readable(self.path), AnyReader([self.path]) as reader:
            wanted = [one for one in reader.connections if one.topic in topics]
            found = reader.messages(connections=wanted, start=start_ns, stop=end_ns + 1) if wanted else ()
            for connection, time_ns, data in found:
                yield PlayedMessage(time_ns, connection.topic, bytes(data))


def _by_rosbags(path: Path, reason: BagError) -> _RosbagsSource:
    try:
        with readable(path), AnyReader([path]) as reader:
            topics: dict[str, PlayedTopic] = {}
            for one in reader.connections:
                before = topics[one.topic].count if one.topic in topics else 0
                topics[one.topic] = _of_connection(one, before + one.msgcount)
            return _RosbagsSource(path=path, topics=topics, start_ns=reader.start_time, end_ns=reader.end_time - 1)
    except (BagError, AnyReaderError) as error:
        raise BagError(f"{reason}; rosbags cannot read it either ({error})") from error


def _of_connection(connection: Any, count: int) -> PlayedTopic:  # noqa: ANN401 - its class is no part of rosbags' API
    ext = connection.ext
    ours = isinstance(ext, ConnectionExtRosbag2)
    profiles = ext.offered_qos_profiles if isinstance(ext, ConnectionExtRosbag2) else []
    return PlayedTopic(
        name=connection.topic,
        type_name=connection.msgtype,
        type_hash=connection.digest if connection.digest.startswith("RIHS01_") else "",
        encoding=ext.serialization_format if ours else "ros1",
        latched=any(one.durability == QosDurability.TRANSIENT_LOCAL for one in profiles),
        count=count,
    )
