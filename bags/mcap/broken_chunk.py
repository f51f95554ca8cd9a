"""The chunk in which a file breaks off: what it holds of whole messages."""

import struct

import numpy as np
from mcap.opcode import Opcode

from bags.mcap.chunk import MESSAGE_HEAD
from bags.mcap.expand import MAX_CHUNK_BYTES, expand_prefix
from bags.mcap.file_bytes import FileBytes
from bags.mcap.messages import MessageTable, chosen, walk

_HEAD = struct.Struct("<BQQQQII")
_NAMES = {b"": "", b"lz4": "lz4", b"zstd": "zstd"}


def rest_of(source: FileBytes, start: int) -> tuple[bytes, MessageTable] | None:
    """Content and messages of a chunk that the file ends in, None when it cannot be told.

    Only messages are taken whose head agrees with the head of the chunk and with the message before it: a known time
    range and ascending sequence numbers of its channel. Zeros at the end of the file, as a power failure leaves them,
    do not count as data.
    """
    raw = source.read(start, min(source.size - start, MAX_CHUNK_BYTES)).rstrip(b"\0")
    if len(raw) < _HEAD.size:
        return None
    opcode, length, start_ns, end_ns, size, _, letters = _HEAD.unpack_from(raw)
    at = _HEAD.size + letters + 8
    name = raw[_HEAD.size : _HEAD.size + letters]
    if opcode != Opcode.CHUNK or name not in _NAMES or len(raw) <= at or size > MAX_CHUNK_BYTES:
        return None
    (stored,) = struct.unpack_from("<Q", raw, at - 8)
    if at + stored != length + 9:
        return None  # the two lengths of the record contradict each other
    content, whole = expand_prefix(_NAMES[name], raw[at:])
    if whole and name:
        return None  # all of it is there, so its check sum was wrong
    table = walk(content)
    sequences: dict[int, int] = {}
    for position, (first, channel_id, time) in enumerate(
        zip(table.starts.tolist(), table.channel_ids.tolist(), table.log_times.tolist(), strict=True)
    ):
        sequence = MESSAGE_HEAD.unpack_from(content, first)[3]
        if not start_ns <= time <= end_ns or sequence != sequences.get(channel_id, sequence - 1) + 1:
            return content, chosen(table, np.arange(len(table)) < position)
        sequences[channel_id] = sequence
    return content, table
