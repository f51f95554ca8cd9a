"""An MCAP chunk while it fills: the bytes of its messages, and where each of them stands."""

import struct
from array import array

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

# opcode, record length, channel id, sequence, log time [ns], publish time [ns]
MESSAGE_HEAD = struct.Struct("<BQHIQQ")
MESSAGE_HEAD_LENGTH = 22  # what of the head counts into the record length
# opcode, record length, channel id, length of the entries
INDEX_HEAD = struct.Struct("<BQHI")
RECORD_HEAD_BYTES = 9  # opcode and length
ENTRY_BYTES = 16  # log time and offset


class OpenChunk:
    """Messages that wait for their chunk to be closed."""

    def __init__(self) -> None:
        """Start empty."""
        self.buffer = bytearray()
        self.channel_ids: list[NDArray[np.uint16]] = []
        self.entries: list[NDArray[np.uint64]] = []  # columns: log time [ns], offset in the chunk
        self._single_ids = array("H")
        self._single_entries = array("Q")  # log time and offset of one message after the other

    def add(self, channel_id: int, log_time: int, head: bytes, data: bytes) -> None:
        """Append one message: its MCAP head and its payload."""
        self._single_ids.append(channel_id)
        self._single_entries.append(log_time)
        self._single_entries.append(len(self.buffer))
        self.buffer += head
        self.buffer += data

    def extend(self, channel_ids: NDArray[np.uint16], entries: NDArray[np.uint64], records: memoryview) -> None:
        """Append complete message records.

        Args:
            channel_ids: Channel of each message, shape (messages,).
            entries: Log time [ns] and offset from the start of `records` of each message, shape (messages, 2).
            records: The records.
        """
        self._gather()
        entries[:, 1] += np.uint64(len(self.buffer))
        self.channel_ids.append(channel_ids)
        self.entries.append(entries)
        self.buffer += records

    def time_range_ns(self) -> tuple[int, int]:
        """Earliest and latest log time [ns]; the chunk must not be empty."""
        self._gather()
        return min(int(part[:, 0].min()) for part in self.entries), max(int(part[:, 0].max()) for part in self.entries)

    def index_records(self) -> tuple[dict[int, int], dict[int, int], bytes]:
        """One MessageIndex record for each channel, by channel id.

        Returns:
            Where the record of each channel starts behind the chunk, how many messages each channel has, all bytes.
        """
        self._gather()
        channel_ids, entries = np.concatenate(self.channel_ids), np.concatenate(self.entries)
        order = np.argsort(channel_ids, kind="stable")
        channel_ids = channel_ids[order]
        raw = entries[order].astype("<u8", copy=False).tobytes()
        starts = np.flatnonzero(np.diff(channel_ids, prepend=0)).tolist()
        offsets: dict[int, int] = {}
        counts: dict[int, int] = {}
        records = bytearray()
        for start, end in zip(starts, [*starts[1:], len(channel_ids)], strict=True):
            channel_id, size = int(channel_ids[start]), ENTRY_BYTES * (end - start)
            offsets[channel_id], counts[channel_id] = len(records), end - start
            records += INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, 6 + size, channel_id, size)
            records += raw[ENTRY_BYTES * start : ENTRY_BYTES * end]
        return offsets, counts, bytes(records)

    def _gather(self) -> None:
        if self._single_ids:
            self.channel_ids.append(np.frombuffer(self._single_ids, dtype=np.uint16))
            self.entries.append(np.frombuffer(self._single_entries, dtype=np.uint64).reshape(-1, 2))
            self._single_ids, self._single_entries = array("H"), array("Q")
