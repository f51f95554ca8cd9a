"""Where the messages stand in the content of a chunk."""

import struct
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from bags.mcap.chunk import MESSAGE_HEAD, MESSAGE_HEAD_LENGTH

_HEAD = np.dtype(
    {
        "names": ["opcode", "length", "channel_id", "log_time"],
        "formats": ["u1", "<u8", "<u2", "<u8"],
        "offsets": [0, 1, 9, 15],
        "itemsize": MESSAGE_HEAD.size,
    }
)
_RECORD_HEAD = struct.Struct("<BQ")
_FRAME = _RECORD_HEAD.size


@dataclass(frozen=True, slots=True, kw_only=True)
class MessageTable:
    """The messages of a chunk in the order of the file.

    Attributes:
        starts: Where each message record starts, shape (messages,).
        ends: Where it ends, shape (messages,).
        channel_ids: Shape (messages,).
        log_times: Shape (messages,) [ns].
        definitions: Schema and channel records in the chunk: opcode, start of the body, end.
        whole: Whether nothing but records was found, up to the end.
    """

    starts: NDArray[np.int64]
    ends: NDArray[np.int64]
    channel_ids: NDArray[np.uint16]
    log_times: NDArray[np.uint64]
    definitions: tuple[tuple[int, int, int], ...]
    whole: bool

    def __len__(self) -> int:
        """Number of messages."""
        return len(self.starts)


def walk(content: bytes) -> MessageTable:
    """Find the messages by going from record to record, up to the first one that is none."""
    starts: list[int] = []
    ends: list[int] = []
    definitions: list[tuple[int, int, int]] = []
    at, size = 0, len(content)
    while at + _FRAME <= size:
        opcode, length = _RECORD_HEAD.unpack_from(content, at)
        end = at + _FRAME + length
        if end > size or opcode == 0 or (opcode == Opcode.MESSAGE and length < MESSAGE_HEAD_LENGTH):
            break
        if opcode == Opcode.MESSAGE:
            starts.append(at)
            ends.append(end)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            definitions.append((opcode, at + _FRAME, end))
        at = end
    return _table(content, np.array(starts, dtype=np.int64), np.array(ends, dtype=np.int64), definitions, at == size)


def chosen(table: MessageTable, rows: NDArray[np.bool_]) -> MessageTable:
    """Some messages of a table."""
    return MessageTable(
        starts=table.starts[rows],
        ends=table.ends[rows],
        channel_ids=table.channel_ids[rows],
        log_times=table.log_times[rows],
        definitions=table.definitions,
        whole=False,
    )


def table_by_index(content: bytes, index: Mapping[int, NDArray[np.int64]]) -> MessageTable | None:
    """Find the messages by the message index, many times faster, or None where index and content disagree.

    Args:
        content: The content of the chunk.
        index: Log time and offset of each message by channel id, shape (messages, 2).
    """
    if not index:
        return None
    entries = np.concatenate(list(index.values()))
    claimed = np.repeat(np.array(list(index), dtype=np.int64), [len(one) for one in index.values()])
    order = np.argsort(entries[:, 1], kind="stable")
    starts, claimed, times = entries[order, 1], claimed[order], entries[order, 0].astype(np.uint64)
    if not len(starts) or starts[0] != 0 or int(starts[-1]) + MESSAGE_HEAD.size > len(content):
        return None
    heads = _heads(content, starts)
    lengths = heads["length"]
    if np.any(heads["opcode"] != Opcode.MESSAGE) or np.any(lengths > len(content)):
        return None
    ends = starts + _FRAME + lengths.astype(np.int64)
    if np.any(lengths < MESSAGE_HEAD_LENGTH) or np.any(ends != np.append(starts[1:], len(content))):
        return None
    if np.any(heads["channel_id"] != claimed) or np.any(heads["log_time"] != times):
        return None
    return _table(content, starts, ends, [], whole=True)


def _heads(content: bytes, starts: NDArray[np.int64]) -> NDArray[np.void]:
    room = max(len(content) - MESSAGE_HEAD.size + 1, 0)
    windows = np.ndarray((room,), dtype=f"V{MESSAGE_HEAD.size}", buffer=content, strides=(1,))
    return windows[starts].view(_HEAD)


def _table(
    content: bytes,
    starts: NDArray[np.int64],
    ends: NDArray[np.int64],
    definitions: list[tuple[int, int, int]],
    whole: bool,  # noqa: FBT001 - a fact that is passed on, not a switch
) -> MessageTable:
    heads = _heads(content, starts) if len(starts) else np.empty(0, dtype=_HEAD)
    return MessageTable(
        starts=starts,
        ends=ends,
        channel_ids=heads["channel_id"].astype(np.uint16),
        log_times=heads["log_time"].astype(np.uint64),
        definitions=tuple(definitions),
        whole=whole,
    )
