"""Recording a run: a rosbag2 directory with MCAP files and metadata.yaml."""

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from bags.mcap.blocks import BlockFormat, block_format, head_field
from bags.mcap.buffer import ChunkBuffer
from bags.mcap.chunk import MESSAGE_HEAD, MESSAGE_HEAD_LENGTH, OpenChunk
from bags.mcap.errors import BagError
from bags.mcap.file_series import FileSeries
from bags.mcap.packing import Compression, packer
from bags.mcap.recording import CHUNK_PRESETS, Buffer, ChunkPreset, Recording, Split, TopicFilter, WhenFull
from bags.mcap.topic import Topic, TopicKind

_SAFE = CHUNK_PRESETS[ChunkPreset.SAFE]


class BagWriter:
    """Writes messages in the order in which they come; a context manager.

    The same messages in the same order give the same file, whether they come one by one or as blocks, as long as no
    chunk is closed by its age.
    """

    def __init__(
        self,
        path: Path,
        topics: Sequence[Topic],
        *,
        compression: Compression = Compression.ZSTD,
        chunk_bytes: int = _SAFE.max_bytes,
        max_chunk_age_sec: float | None = _SAFE.max_age_sec,
        custom_data: Mapping[str, str] | None = None,
        split: Split | None = None,
        topic_filter: TopicFilter | None = None,
        buffer: Buffer | None = None,
    ) -> None:
        """Create the directory and the head of its file.

        Args:
            path: The bag's directory; must not exist.
            topics: Topics in the order of their channels.
            compression: Of the chunks.
            chunk_bytes: A chunk is closed once it holds this much, before compression.
            max_chunk_age_sec: A chunk is closed, at the latest, by the first message that comes this long (wall
                time) after its first one; None: by size only.
            custom_data: Free texts for metadata.yaml.
            split: When to go on in another file; None: never.
            topic_filter: What to record; None: everything. Messages on other topics are taken and left out.
            buffer: Write in a thread of its own behind a buffer of this kind; None: write at once.

        Raises:
            BagError: The path exists or cannot be made.
        """
        self._path = path
        self._chunk_bytes = chunk_bytes
        self._max_age = float("inf") if max_chunk_age_sec is None else max_chunk_age_sec
        self._topics: dict[str, Topic] = {}
        self._ignored: set[str] = set()
        self._filter = topic_filter or TopicFilter()
        self._sequences: dict[str, int] = {}
        self._chunk = OpenChunk()
        self._opened_at = time.monotonic()
        self._closed = False
        self._pack = packer(compression)
        self._files = FileSeries(path, compression, split or Split())
        self._files.note(custom_data or {})
        self._buffer: ChunkBuffer | None = None
        for topic in topics:
            self.add_topic(topic)
        self._drops = buffer is not None and buffer.when_full is WhenFull.DROP
        self._dropping = (-1, False)  # stamp of the latest step, and whether it is dropped
        self._dropped: dict[str, int] = {}
        if buffer is not None:
            self._buffer = ChunkBuffer(self._files.add_chunk, buffer.max_bytes)

    @property
    def path(self) -> Path:
        """The bag's directory."""
        return self._path

    @property
    def counts(self) -> Mapping[str, int]:
        """Messages taken so far by topic name."""
        return dict(self._sequences)

    @property
    def dropped(self) -> Mapping[str, int]:
        """Messages left out because the buffer was full, by topic name."""
        return dict(self._dropped)

    def add_topic(self, topic: Topic) -> None:
        """Announce a topic, before its first message.

        Raises:
            BagError: It is announced already, or its type is unknown; or the disk refuses.
        """
        if topic.name in self._topics:
            raise BagError(f"{self._path}: topic {topic.name} is announced twice")
        if not self._filter.accepts(topic.name):
            self._ignored.add(topic.name)
            return
        if self._buffer is not None:
            self._buffer.drain()  # its thread writes to the same file
        self._files.announce(topic)
        self._topics[topic.name] = topic
        self._sequences[topic.name] = 0

    def write(self, topic: str, stamp_ns: int, data: bytes) -> None:
        """Append one message.

        Args:
            topic: Name of an announced topic.
            stamp_ns: Its simulated time: log time and publish time.
            data: The bytes on the wire.

        Raises:
            BagError: The topic is not announced, the bag is closed, or the disk refuses.
        """
        channel_id = self._files.channel_ids.get(topic)
        if topic in self._ignored and self._files.open:
            return
        if channel_id is None or not self._files.open:
            if self._buffer is not None:
                self._buffer.drain()  # says why
            raise BagError(f"{self._path}: message on {topic}, expected {self._expectation()}")
        sequence = self._sequences[topic]
        self._sequences[topic] = sequence + 1
        if self._drops and self._left_out(self._topics[topic], stamp_ns):
            return
        length = MESSAGE_HEAD_LENGTH + len(data)
        head = MESSAGE_HEAD.pack(Opcode.MESSAGE, length, channel_id, sequence, stamp_ns, stamp_ns)
        now = time.monotonic()
        if not self._chunk.buffer:
            self._opened_at = now
        self._chunk.add(channel_id, stamp_ns, head, data)
        if len(self._chunk.buffer) >= self._chunk_bytes or now - self._opened_at >= self._max_age:
            self._close_chunk()

    def format_of(self, topics: Sequence[Topic]) -> BlockFormat:
        """Format of the blocks that `write_block` takes."""
        return block_format(topics, {**dict.fromkeys(self._ignored, 0), **self._files.channel_ids})

    def write_block(self, layout: BlockFormat, block: NDArray[np.void]) -> None:
        """Append many rows of messages.

        Args:
            layout: What `format_of` gave.
            block: Rows as `layout.block` makes them, shape (rows,); sequence numbers are filled in here.

        Raises:
            BagError: The bag is closed, or the disk refuses.
        """
        if not self._files.open:
            raise BagError(f"{self._path}: block of messages, expected {self._expectation()}")
        if self._ignored:
            layout, block = self._kept(layout, block)
        if not len(block) or not layout.topics:
            return
        for topic in layout.topics:
            first = self._sequences[topic.name]
            block[head_field(topic)]["sequence"] = np.arange(first, first + len(block))
            self._sequences[topic.name] = first + len(block)
        times = np.repeat(block[head_field(layout.topics[0])]["log_time"], len(layout.topics))
        channel_ids = np.tile(layout.channel_ids, len(block))
        rows = np.arange(len(block), dtype=np.int64)[:, None] * layout.dtype.itemsize
        starts = np.append((rows + layout.starts).ravel(), len(block) * layout.dtype.itemsize)
        records = np.ascontiguousarray(block).view(np.uint8).data
        at = 0
        while at < len(channel_ids):
            # the first message whose end fills the chunk still belongs into it
            wanted = starts[at] + self._chunk_bytes - len(self._chunk.buffer)
            end = min(max(int(np.searchsorted(starts, wanted)), at + 1), len(channel_ids))
            entries = np.stack([times[at:end], (starts[at:end] - starts[at]).astype(np.uint64)], axis=1)
            if not self._chunk.buffer:
                self._opened_at = time.monotonic()
            self._chunk.extend(channel_ids[at:end], entries, records[starts[at] : starts[end]])
            if len(self._chunk.buffer) >= self._chunk_bytes or time.monotonic() - self._opened_at >= self._max_age:
                self._close_chunk()
            at = end

    def attach(self, name: str, data: bytes, media_type: str = "text/plain") -> None:
        """Put a document into the bag.

        Raises:
            BagError: The disk refuses.
        """
        if self._buffer is not None:
            self._buffer.drain()
        self._files.attach(name, data, media_type)

    def flush(self) -> None:
        """Close the open chunk and hand it to the operating system, or to the buffer if there is one.

        Raises:
            BagError: The disk refuses.
        """
        if self._chunk.buffer:
            self._close_chunk()

    def close(self) -> None:
        """Complete the file and write metadata.yaml; a second call does nothing.

        Raises:
            BagError: The disk refuses.
        """
        if self._closed:
            return
        self._closed = True
        try:
            if self._files.open:
                self.flush()
        finally:
            self._finish()

    def _finish(self) -> None:
        try:
            if self._buffer is not None:
                self._buffer.close()
        finally:
            if self._files.open:
                if self._dropped:
                    self._files.note({"dropped_messages": str(sum(self._dropped.values()))})
                self._files.finish()

    def _kept(self, layout: BlockFormat, block: NDArray[np.void]) -> tuple[BlockFormat, NDArray[np.void]]:
        """Format and rows without the topics that are not recorded."""
        topics = [topic for topic in layout.topics if topic.name not in self._ignored]
        kept = block_format(topics, self._files.channel_ids)
        rows = np.empty(len(block), dtype=kept.dtype)
        for name in kept.dtype.names or ():
            rows[name] = block[name]
        return kept, rows

    def __enter__(self) -> Self:
        """Return self."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close, whatever happened: what was recorded stays readable."""
        self.close()

    def _close_chunk(self) -> None:
        chunk, self._chunk = self._pack(self._chunk), OpenChunk()
        if self._buffer is None:
            self._files.add_chunk(chunk)
        else:
            self._buffer.put(chunk, wait=not self._drops)

    def _left_out(self, topic: Topic, stamp_ns: int) -> bool:
        """Whether the step that a message belongs to is dropped: decided with its first message, for all of them."""
        if topic.kind is not TopicKind.PER_STEP:
            return False
        if stamp_ns != self._dropping[0]:
            self._dropping = (stamp_ns, self._buffer is not None and self._buffer.full)
        if not self._dropping[1]:
            return False
        self._dropped[topic.name] = self._dropped.get(topic.name, 0) + 1
        return True

    def _expectation(self) -> str:
        return "an announced topic" if self._files.open else "nothing more: the bag is closed"


def open_recording(path: Path | str, topics: Sequence[Topic], recording: Recording) -> BagWriter:
    """A writer that takes messages while a run goes on.

    Args:
        path: The bag's directory; must not exist.
        topics: Topics in the order of their channels.
        recording: How they are recorded.

    Raises:
        BagError: The path exists or cannot be made.
    """
    path = Path(path)
    chunks = CHUNK_PRESETS[recording.chunks]
    return BagWriter(
        path,
        topics,
        compression=recording.compression,
        chunk_bytes=chunks.max_bytes,
        max_chunk_age_sec=chunks.max_age_sec,
        split=recording.split,
        topic_filter=recording.topics,
        buffer=recording.buffer,
    )
