"""The MCAP files of a bag being recorded, one after the other, and metadata.yaml that describes them all."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from mcap.well_known import MessageEncoding, Profile, SchemaEncoding

from bags.mcap.errors import BagError
from bags.mcap.mcap_file import McapFile
from bags.mcap.metadata import BagInfo, FileEntry, TopicEntry, offered_qos_text, write_metadata
from bags.mcap.packing import Compression, PackedChunk
from bags.mcap.recording import Split
from bags.mcap.topic import Topic
from bags.mcap.typestore import schema_text, type_hash


class FileSeries:
    """Takes closed chunks and spreads them over files; whatever the disk does, what is left is a valid bag."""

    def __init__(self, path: Path, compression: Compression, split: Split) -> None:
        """Create the directory and the head of the first file.

        Args:
            path: The bag's directory; must not exist.
            compression: Of the chunks.
            split: When to go on in another file.

        Raises:
            BagError: The path exists or cannot be made.
        """
        self._path = path
        self._compression = compression
        self._split = split
        self._custom: dict[str, str] = {}
        self._topics: dict[str, Topic] = {}
        self._schema_ids: dict[str, int] = {}
        self._done: list[FileEntry] = []
        self._done_counts: dict[int, int] = {}  # messages in complete files by channel id
        self.channel_ids: dict[str, int] = {}
        self.open = True
        with self._disk():
            _make_directory(path)
            self._file = McapFile(path / self._file_name(0), compression, Profile.ROS2)

    def announce(self, topic: Topic) -> None:
        """Add the channel of a topic.

        Raises:
            BagError: Its type is unknown, or the disk refuses.
        """
        with self._disk():
            self._announce(self._file, topic)
        self._topics[topic.name] = topic

    def attach(self, name: str, data: bytes, media_type: str) -> None:
        """Put a document into the bag.

        Raises:
            BagError: The disk refuses.
        """
        with self._disk():
            self._file.add_attachment(name, media_type, data)

    def note(self, texts: Mapping[str, str]) -> None:
        """Put free texts into metadata.yaml."""
        self._custom |= texts

    def add_chunk(self, chunk: PackedChunk) -> None:
        """Write a closed chunk, into the next file where the split says so.

        Raises:
            BagError: The disk refuses; the bag is closed and says up to when it is valid.
        """
        start_ns, _ = self._file.time_range_ns
        try:
            if sum(self._file.counts.values()) and self._split.due(self._file.size, start_ns, chunk.time_range_ns[1]):
                self._next_file()
            self._file.add_packed(chunk)
        except OSError as error:
            self.finish()
            end_ns = max([self._file.time_range_ns[1], *(one.end_ns for one in self._done)])
            count = sum(self._file.counts.values()) + sum(one.count for one in self._done)
            raise BagError(
                f"{self._path}: cannot write the bag ({error.strerror or error}); it is closed and valid up to "
                f"{end_ns * 1e-9:g} s, {count} messages"
            ) from error

    def finish(self) -> None:
        """Complete the bag; chunks are dropped from its end while there is no room for summary and metadata.

        Raises:
            BagError: Not even the summary of an empty file has room.
        """
        self.open = False
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
        entries = [TopicEntry.of(one, counts.get(self.channel_ids[name], 0)) for name, one in self._topics.items()]
        write_metadata(self._path, BagInfo(files=self._done, topics=entries, custom=self._custom).to_yaml())

    def _information(self) -> str:
        """metadata.yaml of all files."""
        counts = {
            channel_id: count + self._done_counts.get(channel_id, 0) for channel_id, count in self._file.counts.items()
        }
        entries = [TopicEntry.of(topic, counts[self.channel_ids[name]]) for name, topic in self._topics.items()]
        return BagInfo(files=[*self._done, self._file_entry()], topics=entries, custom=self._custom).to_yaml()

    def _file_entry(self) -> FileEntry:
        start_ns, end_ns = self._file.time_range_ns
        name, count = self._file_name(len(self._done)), sum(self._file.counts.values())
        return FileEntry(name=name, start_ns=start_ns, end_ns=end_ns, count=count)

    def _file_name(self, number: int) -> str:
        return f"{self._path.name}_{number}.mcap"

    def _announce(self, file: McapFile, topic: Topic) -> None:
        if topic.type_name not in self._schema_ids:
            text = dict(topic.definitions).get(topic.type_name) or schema_text(topic.type_name)
            self._schema_ids[topic.type_name] = file.add_schema(topic.type_name, SchemaEncoding.ROS2, text.encode())
        metadata = {
            "offered_qos_profiles": offered_qos_text(topic),
            "topic_type_hash": type_hash(topic.type_name, topic.definitions),
        }
        self.channel_ids[topic.name] = file.add_channel(
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
            topics = [TopicEntry.of(topic, counts[self.channel_ids[name]]) for name, topic in self._topics.items()]
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
