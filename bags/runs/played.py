"""What a bag of any origin offers for playing: its topics, and its messages one after the other."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel

from bags.mcap.chunk import MESSAGE_HEAD, MESSAGE_HEAD_LENGTH
from bags.mcap.container import ChunkView, Container, open_container, readable
from bags.mcap.errors import BagError
from bags.mcap.frames import FRAME
from bags.mcap.typestore import PACKAGE
from bags.sources.latching import is_latched
from bags.sources.recorded import Known, Recorded, open_recorded

CDR = "cdr"
# fields of a message type and of all types inside it, by name, as rosbags keeps them
Layout: TypeAlias = Mapping[str, Sequence[tuple[str, Any]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayedTopic:
    """A topic of a bag.

    Attributes:
        name: Its ROS name.
        type_name: Full message type name.
        type_hash: RIHS01 hash of its type, "" when the bag holds none.
        fault: Why it cannot be published, "" when nothing here speaks against it.
        latched: Whether a late subscriber got what was published before.
        count: Number of messages.
        layouts: What its messages are laid out by, as far as the bag or `--definitions` say so.
    """

    name: str
    type_name: str
    type_hash: str
    fault: str
    latched: bool
    count: int
    layouts: tuple[Layout, ...] = field(default=(), repr=False)


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


def open_source(path: Path | str, known: Known | None = None) -> Source:
    """Open a bag for playing: ours, or one by any other program that writes rosbag2 (MCAP or sqlite3).

    Args:
        path: The bag's directory.
        known: Definitions for what the bag does not define itself.

    Raises:
        BagError: Not a bag, not closed, or damaged: one line.
    """
    path = Path(path)
    try:
        container = open_container(path)
    except BagError:
        return _RecordedSource.of(path, known)
    return _ChunkSource.of(container) if is_ours(container) else _RecordedSource.of(path, known)


def is_ours(container: Container) -> bool:
    """Whether we wrote a bag: then its indexes can be relied on, and nothing but its chunks is compressed."""
    mode = str(container.information.get("compression_mode") or "").lower()
    ours = any(name.startswith(f"{PACKAGE}/") for name in container.topics.values())
    return ours and mode in {"", "none"} and container.promised == sum(container.counts.values())


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
                fault=_fault([types[name]], [channel.message_encoding]),
                latched=is_latched(channel.metadata.get("offered_qos_profiles", "")),
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


@dataclass(frozen=True, slots=True, kw_only=True)
class _RecordedSource:
    """A recording of any origin, each message as it was published: decompressed, whatever its file did to it."""

    path: Path
    topics: Mapping[str, PlayedTopic]
    start_ns: int
    end_ns: int
    attachments: Mapping[str, bytes]

    @classmethod
    def of(cls, path: Path, known: Known | None) -> "_RecordedSource":
        with open_recorded(path, known) as recorded:
            start_ns, end_ns = 2**63 - 1, -(2**63)
            for message in recorded.messages(recorded.channels):
                start_ns, end_ns = min(start_ns, message.time_ns), max(end_ns, message.time_ns)
            empty = end_ns < start_ns
            return cls(
                path=path,
                topics={topic: _played(recorded, topic) for topic in recorded.topics},
                start_ns=0 if empty else start_ns,
                end_ns=0 if empty else end_ns,
                attachments=recorded.attachments,
            )

    def messages(self, topics: Collection[str], start_ns: int, end_ns: int) -> Iterator[PlayedMessage]:
        """Messages with stamps in [start_ns, end_ns], in the order of the files."""
        with open_recorded(self.path) as recorded:
            wanted = [one for one in recorded.channels if one.topic in topics]
            for channel, time_ns, data in recorded.messages(wanted):
                if start_ns <= time_ns <= end_ns:
                    yield PlayedMessage(time_ns, channel.topic, data)


def _fault(types: Sequence[str], encodings: Sequence[str]) -> str:
    if len(types) > 1:
        return f"has messages of {' and '.join(types)}, expected one type"
    return "" if list(encodings) == [CDR] else f"its messages are encoded as {' and '.join(encodings)}, expected {CDR}"


def _played(recorded: Recorded, topic: str) -> PlayedTopic:
    channels = [one for one in recorded.topics[topic] if recorded.channels[one]] or recorded.topics[topic]
    types = list(dict.fromkeys(one.definition.type_name for one in channels))
    encodings = list(dict.fromkeys(one.definition.encoding for one in channels))
    return PlayedTopic(
        name=topic,
        type_name=types[0],
        type_hash=channels[0].definition.type_hash,
        fault=_fault(types, encodings),
        latched=any(one.latched for one in channels),
        count=sum(recorded.channels[one] for one in channels),
        layouts=tuple(found.fields for one in channels if not isinstance(found := recorded.decoders[one], str)),
    )
