"""Any topic of a bag as numpy blocks: the public reader.

with nothing in memory but one block:

bag = open_bag(path)
for block in bag.blocks("/dgu_1/state"):
    block.time_ns, block.data["x"]
"""

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype

from bags.mcap.cdr import Layout, layout_of
from bags.mcap.chunk import MESSAGE_HEAD, MESSAGE_HEAD_LENGTH
from bags.mcap.container import ChunkView, Container, open_container, readable
from bags.mcap.definitions import differing, is_standard
from bags.mcap.errors import BagError
from bags.mcap.typestore import PACKAGE, Definitions, typestore_of
from bags.mcap.varying_text import of_varying_text

BLOCK_ROWS = 10_000
_LENGTH = ".length"  # of the one string in a layout
_CONSTANT = {
    f"{PACKAGE}/msg/{name}" for name in ("Alarm", "InputEstimate", "Output", "Own", "Residual", "State", "TeamEstimate")
}
"""Types whose sequences are as long in every message of a topic."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TopicInfo:
    """One topic of a bag.

    Attributes:
        name: ROS topic name.
        type_name: Full message type name.
        count: Number of messages.
    """

    name: str
    type_name: str
    count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class TopicBlock:
    """Consecutive messages of one topic.

    Attributes:
        topic: ROS topic name.
        time_ns: Log time of each message, shape (messages,) [ns].
        data: The messages, shape (messages,); the fields of its dtype are the message's, nested ones with dots
            (`header.stamp.sec`), arrays as sub-arrays: `data["x"]` has shape (messages, 3).
    """

    topic: str
    time_ns: NDArray[np.int64]
    data: NDArray[np.void]


@dataclass(frozen=True, slots=True, kw_only=True)
class Bag:
    """A bag opened for reading; holds no file open and no message in memory.

    Attributes:
        path: The directory.
        topics: Topics by name, in the order of the channels.
        start_ns: Earliest stamp [ns].
        end_ns: Latest stamp [ns].
        attachments: Documents in the bag by name.
    """

    path: Path
    topics: Mapping[str, TopicInfo]
    start_ns: int
    end_ns: int
    attachments: Mapping[str, bytes]
    _container: Container

    def blocks(self, topic: str, rows: int = BLOCK_ROWS) -> Iterator[TopicBlock]:
        """All messages of a topic of fixed length in blocks, in the order of the file.

        Args:
            topic: ROS topic name.
            rows: A block is given once it holds this many messages or more: at most one chunk more.

        Raises:
            BagError: No such topic, its messages vary in length (see `messages`), or the bag is damaged.
        """
        type_name = self._topic(topic).type_name
        if type_name not in _CONSTANT and not is_standard(self._container.definitions[topic]):
            raise BagError(f"{self.path}: {topic} holds {type_name} by a definition of its own, see bags.sources")
        layout: Layout | None = None
        older = differing(self._container.definitions.values())
        parts: list[tuple[NDArray[np.int64], NDArray[np.void]]] = []
        for channel_id, chunk in self._chunks(topic):
            with readable(self.path):
                layout = layout or first_layout(type_name, next(chunk.payloads(channel_id)), older)
                parts.append(_records(chunk, channel_id, layout, topic))
            if sum(len(part) for _, part in parts) >= rows:
                yield _block(topic, parts)
                parts = []
        if parts:
            yield _block(topic, parts)

    def array(self, topic: str) -> TopicBlock:
        """All messages of a topic as one block.

        Raises:
            BagError: As `blocks`, or the topic holds no message.
        """
        found = list(self.blocks(topic, max(self._topic(topic).count, 1)))
        if not found:
            raise BagError(f"{self.path}: {topic} holds no message, expected at least one")
        return TopicBlock(
            topic=topic,
            time_ns=np.concatenate([one.time_ns for one in found]),
            data=np.concatenate([one.data for one in found]),
        )

    def messages(self, topic: str) -> Iterator[tuple[int, bytes]]:
        """Log time [ns] and bytes of every message of a topic, of fixed length or not.

        Raises:
            BagError: No such topic, or the bag is damaged.
        """
        self._topic(topic)
        for channel_id, chunk in self._chunks(topic):
            offsets = chunk.offsets[channel_id].tolist()
            for offset, data in zip(offsets, chunk.payloads(channel_id), strict=True):
                yield int(MESSAGE_HEAD.unpack_from(chunk.data.data, offset)[4]), data

    def type_of(self, topic: str) -> str:
        """Full message type name of a topic.

        Raises:
            BagError: No such topic.
        """
        return self._topic(topic).type_name

    def is_fixed(self, topic: str) -> bool:
        """Whether `blocks` can read a topic: its type has neither sequences, unless they never change, nor two strings.

        Raises:
            BagError: No such topic.
        """
        type_name = self._topic(topic).type_name
        if type_name in _CONSTANT:
            return True
        try:
            layout_of(type_name)
        except BagError:
            return False
        return True

    def is_standard(self) -> bool:
        """Whether every message is laid out as ROS 2 Jazzy and dcmg_msgs define its type, and none is compressed."""
        mode = str(self._container.information.get("compression_mode") or "").lower()
        return mode in {"", "none"} and all(is_standard(one) for one in self._container.definitions.values())

    def _topic(self, topic: str) -> TopicInfo:
        if topic not in self.topics:
            raise BagError(f"{self.path}: holds no topic {topic!r}, expected one of {' '.join(self.topics):.200}")
        return self.topics[topic]

    def _chunks(self, topic: str) -> Iterator[tuple[int, ChunkView]]:
        for _, chunk in self._container.chunks({topic}):
            for channel_id, offsets in chunk.offsets.items():
                if len(offsets):
                    yield channel_id, chunk


def open_bag(path: Path | str) -> Bag:
    """Open a closed bag: reads metadata.yaml, the summaries and the attachments.

    Args:
        path: The bag's directory.

    Raises:
        BagError: Not a bag, not closed, or damaged: one line.
    """
    path = Path(path)
    container = open_container(path)
    counts = container.counts
    topics = {
        name: TopicInfo(name=name, type_name=type_name, count=counts[name])
        for name, type_name in container.topics.items()
    }
    spans = [one.statistics for _, one in container.files if one.statistics and one.statistics.message_count]
    return Bag(
        path=path,
        topics=topics,
        start_ns=min((one.message_start_time for one in spans), default=0),
        end_ns=max((one.message_end_time for one in spans), default=0),
        attachments=container.attachments,
        _container=container,
    )


def first_layout(type_name: str, first: bytes, definitions: Definitions = ()) -> Layout:
    """Layout of a type whose string and sequences, if it has them, are as long as in the first message.

    Args:
        type_name: Full message type name.
        first: The message.
        definitions: Of types that are not as ours.
    """
    sequences: tuple[tuple[str, int], ...] = ()
    if type_name in _CONSTANT:
        message = typestore_of(definitions).deserialize_cdr(first, type_name)
        fields = typestore_of(definitions).fielddefs[type_name][1]
        named = [name for name, (kind, _) in fields if kind is Nodetype.SEQUENCE]
        sequences = tuple((name, len(getattr(message, name))) for name in named)
    layout = layout_of(type_name, sequences=sequences, definitions=definitions)
    names, lengths = layout.dtype.names or (), {f"{name}{_LENGTH}" for name, _ in sequences}
    for name in names:
        places: Mapping[str, Any] = layout.dtype.fields or {}
        if name.endswith(_LENGTH) and name.removesuffix(_LENGTH) in names and name not in lengths:
            at = places[name][1]
            if len(first) < at + 4:
                raise BagError(f"{type_name}: found {len(first)} bytes, expected {layout.size} or more")
            (length,) = struct.unpack_from("<I", first, at)
            return layout_of(type_name, first[at + 4 : at + 3 + length].decode(), sequences, definitions)
    return layout


def _records(
    chunk: ChunkView, channel_id: int, layout: Layout, topic: str
) -> tuple[NDArray[np.int64], NDArray[np.void]]:
    """Log times and messages of a channel in a chunk."""
    raw = chunk.records(channel_id, MESSAGE_HEAD.size + layout.size)
    head = [("opcode", "u1"), ("length", "<u8"), ("channel_id", "<u2"), ("sequence", "<u4"), ("log_time", "<i8")]
    dtype = np.dtype([*head, ("publish_time", "<i8"), ("message", layout.dtype)])
    records = None if raw is None else raw.view(dtype)
    if (
        records is None
        or np.any(records["opcode"] != Opcode.MESSAGE)
        or np.any(records["length"] != MESSAGE_HEAD_LENGTH + layout.size)
        or np.any(records["channel_id"] != channel_id)
        or not layout.fits(records["message"])
    ):
        times = [MESSAGE_HEAD.unpack_from(chunk.data.data, at)[4] for at in chunk.offsets[channel_id].tolist()]
        return np.array(times, dtype=np.int64), of_varying_text(list(chunk.payloads(channel_id)), layout, topic)
    return records["log_time"].copy(), records["message"].copy()


def _block(topic: str, parts: list[tuple[NDArray[np.int64], NDArray[np.void]]]) -> TopicBlock:
    times, messages = zip(*parts, strict=True)
    return TopicBlock(topic=topic, time_ns=np.concatenate(times), data=np.concatenate(messages))
