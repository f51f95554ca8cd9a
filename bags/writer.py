"""Recording a run: a rosbag2 directory with MCAP files and metadata.yaml."""

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import final

import numpy as np
from mcap.opcode import Opcode
from mcap.well_known import MessageEncoding, Profile, SchemaEncoding
from numpy.typing import NDArray

from bags.blocks import BlockFormat, block_format, head_field
from bags.chunk import MESSAGE_HEAD, MESSAGE_HEAD_LENGTH, OpenChunk
from bags.errors import BagError
from bags.mcap_file import Compression, McapFile
from bags.metadata import BagInfo, FileEntry, TopicEntry, offered_qos_text, write_metadata
from bags.recording import Split, TopicFilter
from bags.topic import Topic
from bags.typestore import schema_text, type_hash

CHUNK_BYTES = 64 * 1024
MAX_CHUNK_AGE_SEC = 0.1  # so that a recording killed after 10 s keeps 99 %


@final
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
        chunk_bytes: int = CHUNK_BYTES,
        max_chunk_age_sec: float | None = MAX_CHUNK_AGE_SEC,
        custom_data: Mapping[str, str] | None = None,
        split: Split | None = None,
        topic_filter: TopicFilter | None = None,
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

        Raises:
            BagError: The path exists or cannot be made.
        """
        self._path = path
        self._chunk_bytes = chunk_bytes
        self._max_age = float("inf") if max_chunk_age_sec is None else max_chunk_age_sec
        self._custom = dict(custom_data or {})
        self._schema_ids: dict[str, int] = {}
        self._topics: dict[str, Topic] = {}
        self._ignored: set[str] = set()
        self._compression = compression
        self._split = split or Split()
        self._filter = topic_filter or TopicFilter()
        self._done: list[FileEntry] = []
        self._done_counts: dict[int, int] = {}  # messages in complete files by channel id
        self._channel_ids: dict[str, int] = {}
        self._sequences: dict[str, int] = {}
        self._chunk = OpenChunk()
        self._opened_at = time.monotonic()
        self._open = True
        with self._disk():
            _make_directory(path)
            self._file = McapFile(path / self._file_name(0), compression, Profile.ROS2)
        for topic in topics:
            self.add_topic(topic)

    @property
    def path(self) -> Path:
        """The bag's directory."""
        return self._path

    @property
    def counts(self) -> Mapping[str, int]:
        """Messages taken so far by topic name."""
        return dict(self._sequences)

    def add_topic(self, topic: Topic) -> None:
        """Announce a topic.

        Raises:
            BagError: It is announced already, or its type is unknown.
        """
        if topic.name in self._topics:
            raise BagError(f"{self._path}: topic {topic.name} is announced twice")
        if not self._filter.accepts(topic.name):
            self._ignored.add(topic.name)
            return
        with self._disk():
            self._announce(self._file, topic)
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
        channel_id = self._channel_ids.get(topic)
        if topic in self._ignored and self._open:
            return
        if channel_id is None or not self._open:
            raise BagError(f"{self._path}: message on {topic}, expected {self._expectation()}")
        sequence = self._sequences[topic]
        self._sequences[topic] = sequence + 1
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
        return block_format(topics, {**dict.fromkeys(self._ignored, 0), **self._channel_ids})

    def write_block(self, layout: BlockFormat, block: NDArray[np.void]) -> None:
        """Append many rows of messages.

        Args:
            layout: What `format_of` gave.
            block: Rows as `layout.block` makes them, shape (rows,); sequence numbers are filled in here.

        Raises:
            BagError: The bag is closed, or the disk refuses.
        """
        if not self._open:
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
        with self._disk():
            self._file.add_attachment(name, media_type, data)

    def flush(self) -> None:
        """Close the open chunk and hand all to the operating system."""
        if self._chunk.buffer:
            self._close_chunk()

    def close(self) -> None:
        """Complete the file and write metadata.yaml; a second call does nothing.

        Raises:
            BagError: The disk refuses.
        """
        if not self._open:
            return
        try:
            self.flush()
        finally:
            if self._open:
                self._finish()

    def _finish(self) -> None:
        """Complete the bag; chunks are dropped from its end while there is no room for summary and metadata.

        Raises:
            BagError: Not even the summary of an empty file has room.
        """
        self._open = False
        try:
            with self._disk():
                while True:
                    try:
                        self._file.finish({"rosbag2": {"serialized_metadata": self._information()}})
                        write_metadata(self._path, self._information())
                    except OSError:
                        if self._file.drop_last_chunk():
                            continue
                        if not self._done:
                            raise
                        self._drop_file()
                        return
                    else:
                        return
        finally:
            self._file.close()

    def _drop_file(self) -> None:
        """Give up the open file, for which there is no room, and describe those before it.

        Raises:
            OSError: The disk refuses.
        """
        self._file.close()
        (self._path / self._file_name(len(self._done))).unlink()
        counts = self._done_counts
        entries = [TopicEntry.of(one, counts.get(self._channel_ids[name], 0)) for name, one in self._topics.items()]
        write_metadata(self._path, BagInfo(files=self._done, topics=entries, custom=self._custom).to_yaml())

    def _information(self) -> str:
        """metadata.yaml of all files."""
        counts = {
            channel_id: count + self._done_counts.get(channel_id, 0) for channel_id, count in self._file.counts.items()
        }
        entries = [TopicEntry.of(topic, counts[self._channel_ids[name]]) for name, topic in self._topics.items()]
        return BagInfo(files=[*self._done, self._file_entry()], topics=entries, custom=self._custom).to_yaml()

    def _file_entry(self) -> FileEntry:
        start_ns, end_ns = self._file.time_range_ns
        name, count = self._file_name(len(self._done)), sum(self._file.counts.values())
        return FileEntry(name=name, start_ns=start_ns, end_ns=end_ns, count=count)

    def _file_name(self, number: int) -> str:
        return f"{self._path.name}_{number}.mcap"

    def _announce(self, file: McapFile, topic: Topic) -> None:
        if topic.type_name not in self._schema_ids:
            text = schema_text(topic.type_name).encode()
            self._schema_ids[topic.type_name] = file.add_schema(topic.type_name, SchemaEncoding.ROS2, text)
        metadata = {
            "offered_qos_profiles": offered_qos_text(topic),
            "topic_type_hash": type_hash(topic.type_name),
        }
        self._channel_ids[topic.name] = file.add_channel(
            topic.name, MessageEncoding.CDR, self._schema_ids[topic.type_name], metadata
        )

    def _next_file(self) -> None:
        """Complete the file and go on in another one with the same channels.

        Raises:
            OSError: The disk refuses; the file is as it was.
        """
        path = self._path / self._file_name(len(self._done) + 1)
        following = McapFile(path, self._compression, Profile.ROS2)
        try:
            self._schema_ids.clear()
            for topic in self._topics.values():
                self._announce(following, topic)
            entry, counts = self._file_entry(), self._file.counts
            topics = [TopicEntry.of(topic, counts[self._channel_ids[name]]) for name, topic in self._topics.items()]
            information = BagInfo(files=[entry], topics=topics, custom=self._custom).to_yaml()
            self._file.finish({"rosbag2": {"serialized_metadata": information}})
        except OSError:
            following.close()
            path.unlink()
            raise
        self._file.close()
        self._file = following
        self._done.append(entry)
        for channel_id, count in counts.items():
            self._done_counts[channel_id] = self._done_counts.get(channel_id, 0) + count

    def _kept(self, layout: BlockFormat, block: NDArray[np.void]) -> tuple[BlockFormat, NDArray[np.void]]:
        """Format and rows without the topics that are not recorded."""
        topics = [topic for topic in layout.topics if topic.name not in self._ignored]
        kept = block_format(topics, self._channel_ids)
        rows = np.empty(len(block), dtype=kept.dtype)
        for name in kept.dtype.names or ():
            rows[name] = block[name]
        return kept, rows

    def __enter__(self) -> "BagWriter":
        """Return self."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close, whatever happened: what was recorded stays readable."""
        self.close()

    def _close_chunk(self) -> None:
        chunk, self._chunk = self._chunk, OpenChunk()
        start_ns, _ = self._file.time_range_ns
        try:
            if sum(self._file.counts.values()) and self._split.due(self._file.size, start_ns, chunk.time_range_ns()[1]):
                self._next_file()
            self._file.add_chunk(chunk)
        except OSError as error:
            self._finish()
            end_ns = max([self._file.time_range_ns[1], *(one.end_ns for one in self._done)])
            count = sum(self._file.counts.values()) + sum(one.count for one in self._done)
            raise BagError(
                f"{self._path}: cannot write the bag ({error.strerror or error}); it is closed and valid up to "
                f"{end_ns * 1e-9:g} s, {count} messages"
            ) from error

    def _expectation(self) -> str:
        return "an announced topic" if self._open else "nothing more: the bag is closed"

    @contextmanager
    def _disk(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise BagError(f"{self._path}: cannot write the bag ({error.strerror or error})") from error


def _make_directory(path: Path) -> None:
    try:
        path.mkdir(parents=True)
    except FileExistsError:
        raise BagError(f"{path}: exists already, expected the path of a bag to be made") from None
