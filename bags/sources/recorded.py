"""A recording of any origin, opened: its files in order, its channels, and whether all that was promised was read."""

from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from bags.mcap.definitions import CDR, ROS1, Decoder, Types, decoder_of, installed_definition
from bags.mcap.errors import BagError
from bags.mcap.expand import expand
from bags.mcap.kinds import POINTERS, ZSTD_MAGIC, Kind, kind_of
from bags.mcap.unpacked import plain_file
from bags.sources.files import Listing, list_files
from bags.sources.mcap_storage import open_mcap
from bags.sources.ros1_storage import open_ros1
from bags.sources.source import Channel, RawMessage, Storage
from bags.sources.sqlite_storage import SqliteStorage, open_sqlite


@dataclass(frozen=True, slots=True, kw_only=True)
class Known:
    """Definitions from elsewhere than the recording.

    Attributes:
        types: Those of `--definitions`.
        prefixes: Prefixes of installed ROS packages, as in AMENT_PREFIX_PATH.
    """

    types: Types = field(default_factory=dict)
    prefixes: tuple[Path, ...] = ()

    def decoder(self, channel: Channel) -> Decoder:
        """What reads the messages of a channel.

        Raises:
            BagError: Nothing does.
        """
        definition = channel.definition
        others = self.types
        if not definition.text and definition.type_name not in others:
            others = {**installed_definition(definition.type_name, self.prefixes), **others}
        return decoder_of(definition, others)


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """A recording opened for reading.

    Attributes:
        path: What was opened.
        channels: Its channels, each with the number of messages that its files promise.
        stated: Number of messages of each topic as metadata.yaml says; {} without one.
        attachments: Documents in it by name.
        notes: What a person should know.
        decoders: What reads each channel, or one line on why nothing does.
    """

    path: Path
    channels: Mapping[Channel, int]
    stated: Mapping[str, int]
    attachments: Mapping[str, bytes]
    notes: tuple[str, ...]
    decoders: Mapping[Channel, Decoder | str] = field(repr=False)
    _storages: tuple[Storage, ...] = field(repr=False)

    @property
    def topics(self) -> dict[str, list[Channel]]:
        """Channels by topic, topics in order of their names."""
        found: dict[str, list[Channel]] = {}
        for channel in sorted(self.channels, key=lambda one: one.topic):
            found.setdefault(channel.topic, []).append(channel)
        return found

    def unreadable(self, topic: str) -> str:
        """Why a topic cannot be read, "" when it can."""
        channels = [one for one in self.topics[topic] if self.channels[one]] or self.topics[topic]
        types = sorted({one.definition.type_name for one in channels})
        if len(types) > 1:
            return f"has messages of {' and '.join(types)}, expected one type"
        reasons = [found for one in channels if isinstance(found := self.decoders[one], str)]
        return reasons[0] if reasons else ""

    def messages(self, wanted: Collection[Channel]) -> Iterator[RawMessage]:
        """All messages of some channels, file by file; at the end their number is held against what was promised.

        Raises:
            BagError: A file is damaged, or messages are missing.
        """
        counts: dict[Channel, int] = dict.fromkeys(wanted, 0)
        for storage in self._storages:
            for message in storage.messages(wanted):
                counts[message.channel] += 1
                yield message if message.data[:4] != ZSTD_MAGIC else _expanded(self.path, message)
        self._check_counts(counts)

    def _check_counts(self, counts: Mapping[Channel, int]) -> None:
        for channel, count in counts.items():
            if count != self.channels[channel]:
                raise BagError(
                    f"{self.path}: {count} messages on {channel.topic} were read, the file promises "
                    f"{self.channels[channel]}: `dcmg bag check {self.path}` says what is intact"
                )
        for topic in {one.topic for one in counts}:
            read = sum(count for one, count in counts.items() if one.topic == topic)
            whole = all(one in counts for one in self.channels if one.topic == topic)
            if whole and read < self.stated.get(topic, 0):
                raise BagError(
                    f"{self.path}: {read} messages on {topic} were read, metadata.yaml promises {self.stated[topic]}"
                )


@contextmanager
def open_recorded(path: Path | str, known: Known | None = None) -> Iterator[Recorded]:
    """Open a recording: a rosbag2 directory, or one .mcap, .db3 or ROS 1 .bag file, compressed with zstd or not.

    Args:
        path: The recording.
        known: Definitions for what the recording does not define itself.

    Raises:
        BagError: It is none, or cannot be read as a whole: one line.
    """
    path = Path(path)
    listing = list_files(path)
    with ExitStack() as stack:
        storages: list[Storage] = []
        for file in listing.files:
            storage = _open_file(stack.enter_context(plain_file(file)), file, listing)
            stack.callback(storage.close)
            storages.append(storage)
        yield _recorded(path, listing, storages, known or Known())


def _recorded(path: Path, listing: Listing, storages: list[Storage], known: Known) -> Recorded:
    channels: dict[Channel, int] = {}
    attachments: dict[str, bytes] = {}
    notes = list(listing.notes)
    for storage in storages:
        for channel, count in storage.channels.items():
            channels[channel] = channels.get(channel, 0) + count
        attachments |= storage.attachments
        notes += storage.notes if isinstance(storage, SqliteStorage) else ()
    stated = listing.stated
    lost = {topic: count for topic, count in stated.items() if count and topic not in {one.topic for one in channels}}
    if lost:
        topic, count = next(iter(lost.items()))
        raise BagError(f"{path}: holds no topic {topic}, metadata.yaml promises {count} messages on it")
    for topic, count in stated.items():
        there = sum(number for one, number in channels.items() if one.topic == topic)
        if there < count:
            raise BagError(f"{path}: holds {there} messages on {topic}, metadata.yaml promises {count}")
        if there > count:
            notes.append(f"{topic}: {there} messages are there, metadata.yaml tells of {count}")
    decoders: dict[Channel, Decoder | str] = {}
    for channel in channels:
        try:
            decoders[channel] = known.decoder(channel)
        except BagError as error:
            decoders[channel] = str(error)
    return Recorded(
        path=path,
        channels=channels,
        stated=stated,
        attachments=attachments,
        notes=tuple(notes),
        decoders=decoders,
        _storages=tuple(storages),
    )


def _open_file(file: Path, named: Path, listing: Listing) -> Storage:
    """Open one file by what it holds.

    Args:
        file: The file, decompressed.
        named: What to call it.
        listing: Knows the types of topics whose channels do not.
    """
    kind = kind_of(file)
    if kind is Kind.MCAP:
        return open_mcap(file, listing.types)
    if kind is Kind.SQLITE:
        return open_sqlite(file)
    if kind is Kind.ROS1:
        return open_ros1(file)
    what = "is" if kind in POINTERS else f"starts with {file.open('rb').read(8)!r} and is"
    split = kind is Kind.EMPTY and len(listing.files) > 1 and named.suffix == ".mcap"
    advice = f": `dcmg bag repair {named.parent}` keeps what is in the others" if split else ""
    raise BagError(f"{named}: {what} {kind.value}, expected MCAP, sqlite3 or a ROS 1 bag{advice}")


def _expanded(path: Path, message: RawMessage) -> RawMessage:
    """A message that was compressed by itself: no CDR begins with the magic number of zstd."""
    if message.channel.definition.encoding not in {CDR, ROS1}:
        return message
    try:
        return message._replace(data=expand("zstd", message.data))
    except BagError as error:
        raise BagError(f"{path}: a message on {message.channel.topic} cannot be decompressed ({error})") from None
