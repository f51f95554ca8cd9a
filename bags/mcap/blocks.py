"""Many steps of per-step messages as one numpy array that holds complete MCAP message records.

All per-step messages have a fixed length, so the records of one step form a row of constant size, and numpy fills a
column of a thousand steps as fast as Python packs a few messages.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from bags.mcap.cdr import Layout
from bags.mcap.chunk import MESSAGE_HEAD, MESSAGE_HEAD_LENGTH
from bags.mcap.errors import BagError
from bags.mcap.topic import NANOSECONDS_PER_SECOND, Topic

_HEAD = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel_id", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
)


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockFormat:
    """Rows of message records, one message for each of some topics in order.

    Attributes:
        topics: The topics, in the order of their messages.
        channel_ids: MCAP channel of each topic, shape (topics,).
        dtype: One row; for each topic the fields `<name> head` and `<name>` (the dtype of its Layout).
        starts: Where each record starts in a row, bytes, shape (topics,).
        row: A row with all constant parts filled in, shape (1,).
    """

    topics: tuple[Topic, ...]
    channel_ids: NDArray[np.uint16]
    dtype: np.dtype[np.void]
    starts: NDArray[np.int64]
    row: NDArray[np.void]

    def block(self, first_step: int, count: int, period_ns: int) -> NDArray[np.void]:
        """Rows of consecutive steps with stamps, steps and all constant parts filled in.

        Args:
            first_step: Step of the first row.
            count: Number of rows.
            period_ns: T_s [ns].
        """
        rows = np.repeat(self.row, count)
        steps = np.arange(first_step, first_step + count, dtype=np.int64)
        stamps_ns = steps * period_ns
        sec, nanosec = np.divmod(stamps_ns, NANOSECONDS_PER_SECOND)
        for topic in self.topics:
            head, message = rows[head_field(topic)], rows[topic.name]
            head["log_time"] = stamps_ns
            head["publish_time"] = stamps_ns
            for name in message.dtype.names or ():
                if name.endswith(".sec"):
                    message[name] = sec
                elif name.endswith(".nanosec"):
                    message[name] = nanosec
                elif name == "step":
                    message[name] = steps
        return rows


def block_format(topics: Sequence[Topic], channel_ids: Mapping[str, int]) -> BlockFormat:
    """Format of rows that hold one message for each topic.

    Args:
        topics: Topics with a fixed layout.
        channel_ids: MCAP channel of each topic by name.

    Raises:
        BagError: A topic has no fixed layout.
    """
    fields: list[tuple[str, np.dtype[np.void]]] = []
    for topic in topics:
        fields += [(head_field(topic), _HEAD), (topic.name, _layout(topic).dtype)]
    dtype = np.dtype(fields)
    row = np.zeros(1, dtype=dtype)
    for topic in topics:
        layout = _layout(topic)
        row[topic.name] = layout.template(1)
        head = row[head_field(topic)]
        head["opcode"] = Opcode.MESSAGE
        head["length"] = MESSAGE_HEAD_LENGTH + layout.size
        head["channel_id"] = channel_ids[topic.name]
    sizes = [MESSAGE_HEAD.size + _layout(topic).size for topic in topics]
    return BlockFormat(
        topics=tuple(topics),
        channel_ids=np.array([channel_ids[topic.name] for topic in topics], dtype=np.uint16),
        dtype=dtype,
        starts=np.cumsum([0, *sizes[:-1]]),
        row=row,
    )


def head_field(topic: Topic) -> str:
    """Name of the field that holds a topic's message head."""
    return f"{topic.name} head"


def _layout(topic: Topic) -> Layout:
    if topic.layout is None:
        raise BagError(f"{topic.name}: messages of {topic.type_name} vary in length, expected a fixed layout")
    return topic.layout
