"""The per-step messages of a run on their way from chunks into the arrays of a window."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel
from numpy.typing import NDArray

from bags.mcap.batch import Batch, Places
from bags.mcap.cdr import Layout
from bags.mcap.chunk import MESSAGE_HEAD, MESSAGE_HEAD_LENGTH
from bags.mcap.container import ChunkView, record_dtype
from bags.mcap.errors import BagError
from bags.wire.arrays import columns, room
from bags.wire.schema import RunTopics

_ROWS_AT_ONCE = 1000


def decoded(places: Places, content: NDArray[np.uint8], layout: Layout, name: str) -> NDArray[np.void]:
    """The messages of one topic in a batch, once their heads say that they are what the index promised.

    Raises:
        BagError: One is not, or reaches beyond its chunk.
    """
    found = places.records(content, MESSAGE_HEAD.size + layout.size)
    if found is None:
        raise _wrong_length(layout, name)
    raw, channel_ids = found
    records = raw.view(record_dtype(layout.dtype))
    if np.any(records["opcode"] != Opcode.MESSAGE) or np.any(records["length"] != MESSAGE_HEAD_LENGTH + layout.size):
        raise _wrong_length(layout, name)
    if np.any(records["channel_id"] != channel_ids):
        raise BagError(f"{name}: the message index points to messages of another topic")
    messages: NDArray[np.void] = records["message"]
    return messages


def messages_of(chunk: ChunkView, channel_id: int, layout: Layout, name: str) -> NDArray[np.void]:
    """The messages of one topic in one chunk.

    Raises:
        BagError: One is not what the index promised.
    """
    places = Places()
    places.add(chunk.offsets[channel_id], (0, len(chunk.data)), channel_id)
    return decoded(places, chunk.data, layout, name)


def _wrong_length(layout: Layout, name: str) -> BagError:
    return BagError(f"{name}: a message has another length than the {layout.size} bytes of {layout.type_name}")


@dataclass(slots=True, kw_only=True)
class Column:
    """One per-step topic: what of it has been read and where its fields go.

    Attributes:
        name: The topic.
        layout: Of its messages.
        read: Messages read so far.
        filled: Rows of the window that are there already.
    """

    name: str
    layout: Layout
    read: int = 0
    filled: int = 0
    _waiting: Places = field(default_factory=Places)
    _ready: list[NDArray[np.void]] = field(default_factory=list)  # decoded, for rows to come

    def take(self, offsets: NDArray[np.int64], span: tuple[int, int], channel_id: int) -> bool:
        """Take the messages of one chunk of the batch; tell whether enough wait for numpy to be quick."""
        self._waiting.add(offsets, span, channel_id)
        return self._waiting.count >= _ROWS_AT_ONCE

    def decode(self, content: NDArray[np.uint8]) -> None:
        """Decode what waits, out of the content of the batch.

        Raises:
            BagError: A message is not what the index promised, or a step is missing.
        """
        if not self._waiting.count:
            return
        messages = decoded(self._waiting, content, self.layout, self.name)
        self._waiting = Places()
        start = self.read
        self.read += len(messages)
        if "step" in self.layout.names:
            wrong = np.flatnonzero(messages["step"] != np.arange(start, self.read))
            if len(wrong):
                found = int(messages["step"][wrong[0]])
                raise BagError(f"{self.name}: found step {found}, expected step {start + int(wrong[0])}")
        self._ready.append(messages)

    def fill(self, targets: Mapping[str, NDArray[Any]], steps: int) -> None:
        """Copy what has been read to the rows of the window that it belongs to.

        Args:
            targets: Array of each field, shape (steps, ...).
            steps: Rows of the window.
        """
        while self._ready and self.filled < steps:
            messages = self._ready.pop(0)
            taken = messages[: steps - self.filled]
            for name, target in targets.items():
                target[self.filled : self.filled + len(taken)] = taken[name]
            self.filled += len(taken)
            if len(taken) < len(messages):
                self._ready.insert(0, messages[len(taken) :])

    def skip(self) -> None:
        """Drop what has been decoded: no window needs it."""
        self._ready.clear()


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """All per-step topics of a run while its chunks are gone through.

    Attributes:
        topics: The run's topics.
        by_name: The columns.
    """

    topics: RunTopics
    by_name: Mapping[str, Column]

    def windows(
        self, sizes: Sequence[int], chunks: Iterator[tuple[Mapping[int, Channel], ChunkView]]
    ) -> Iterator[dict[str, NDArray[Any]]]:
        """The arrays of consecutive windows.

        Args:
            sizes: Steps of each window.
            chunks: Each chunk with the channels of its file, in order; used up in the end.

        Raises:
            BagError: See `Column.decode`.
        """
        batch = Batch()
        for size in sizes:
            arrays = room(self.topics, size)
            targets = {one.topic.name: one.fields for one in columns(self.topics, arrays, elsewhere=False)}
            self._fill(targets, size, batch)
            batch = Batch()
            while any(column.filled < size for column in self.by_name.values()):
                following = next(chunks, None)
                if following is None or self._take(following, batch):
                    self._fill(targets, size, batch)
                    batch = Batch()
                if following is None:
                    break
            yield arrays
            for column in self.by_name.values():
                column.filled = 0
        for rest in chunks:
            if self._take(rest, batch):
                self._skip(batch)
                batch = Batch()
        self._skip(batch)

    def _take(self, found: tuple[Mapping[int, Channel], ChunkView], batch: Batch) -> bool:
        channels, chunk = found
        span, enough = batch.add(chunk), False
        for channel_id, offsets in chunk.offsets.items():
            enough |= self.by_name[channels[channel_id].topic].take(offsets, span, channel_id)
        return enough

    def _skip(self, batch: Batch) -> None:
        content = batch.content()
        for column in self.by_name.values():
            column.decode(content)
            column.skip()

    def _fill(self, targets: Mapping[str, Mapping[str, NDArray[Any]]], steps: int, batch: Batch) -> None:
        content = batch.content()
        for name, column in self.by_name.items():
            column.decode(content)
            column.fill(targets[name], steps)


def columns_of(topics: RunTopics, recorded: Collection[str]) -> Columns:
    """Columns for a run of which nothing has been read; a topic that was not recorded leaves NaN, 0 or False."""
    by_name = {
        topic.name: Column(name=topic.name, layout=topic.layout)
        for topic in topics.per_step
        if topic.layout is not None and topic.name in recorded
    }
    return Columns(topics=topics, by_name=by_name)
