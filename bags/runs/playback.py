"""What of a bag is played, in which order, and under which names; when it is played is the player's business."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from bags.mcap.errors import BagError
from bags.mcap.recording import TopicFilter
from bags.runs.played import PlayedTopic, Source, open_source
from bags.sources.recorded import Known
from bags.wire.schema import SECOND_PUBLISHER

CLOCK_TOPIC = "/clock"


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """What of a bag is played.

    Attributes:
        topics: Which topics, by their names in the bag.
        remap: Name under which a topic of the bag is published.
        start_offset_sec: Where to start, from the first stamp of the bag [s].
        duration_sec: How long from there, None: to the end [s].
        replaced: Messages that are published first, instead of all that the bag has on their topics.
    """

    topics: TopicFilter = field(default_factory=TopicFilter)
    remap: Mapping[str, str] = field(default_factory=dict)
    start_offset_sec: float = 0.0
    duration_sec: float | None = None
    replaced: Mapping[str, Sequence[bytes]] = field(default_factory=dict)


class Moment(NamedTuple):
    """Consecutive messages of one stamp: in a recorded run, a step.

    Attributes:
        time_ns: The stamp [ns]; never earlier than that of the moment before.
        messages: Topic (its name in the bag) and bytes of each message, in order.
    """

    time_ns: int
    messages: list[tuple[str, bytes]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Playback:
    """A bag opened for playing; no more than a chunk of it is ever in memory.

    Attributes:
        path: The bag.
        topics: The topics to be played, by their names in the bag.
        left_out: Why a selected topic is not played, by name.
        counts: Number of messages of each selected topic in the whole bag, played or not.
        names: Name on the wire of each topic to be played.
        start_ns: Stamp where it starts [ns].
        end_ns: Stamp up to which it goes [ns].
        attachments: Documents in the bag by name.
    """

    path: Path
    topics: Mapping[str, PlayedTopic]
    left_out: Mapping[str, str]
    counts: Mapping[str, int]
    names: Mapping[str, str]
    start_ns: int
    end_ns: int
    attachments: Mapping[str, bytes]
    _source: Source
    _replaced: Mapping[str, Sequence[bytes]]

    def moments(self) -> Iterator[Moment]:
        """Everything to be played, in the order of the bag.

        The first moment holds, before all else, what a late subscriber would have got: the latched messages from
        before the start.

        Raises:
            BagError: The bag is damaged.
        """
        time_ns = self.start_ns
        waiting = self._latched_before()
        played = [name for name in self.topics if name not in self._replaced]
        for message in self._source.messages(played, self.start_ns, self.end_ns):
            # a message that was recorded late stands behind later ones: it goes out with them
            if waiting and message.time_ns > time_ns:
                yield Moment(time_ns, waiting)
                waiting = []
            time_ns = max(time_ns, message.time_ns)
            waiting.append((message.topic, message.data))
        if waiting:
            yield Moment(time_ns, waiting)

    def stamps(self, topic: str) -> Iterator[int]:
        """Stamps of the messages of one topic [ns], in the order of the bag."""
        if topic in self.topics:
            yield from (message.time_ns for message in self._source.messages([topic], self.start_ns, self.end_ns))

    def _latched_before(self) -> list[tuple[str, bytes]]:
        found = [(name, data) for name, messages in self._replaced.items() for data in messages if name in self.topics]
        latched = [name for name, topic in self.topics.items() if topic.latched and name not in self._replaced]
        if latched and self.start_ns > self._source.start_ns:
            earlier = self._source.messages(latched, self._source.start_ns, self.start_ns - 1)
            found += [(message.topic, message.data) for message in earlier]
        return found


def open_playback(path: Path | str, selection: Selection, known: Known | None = None) -> Playback:
    """Open a bag for playing.

    Args:
        path: The bag's directory; ours, or a rosbag2 directory (MCAP or sqlite3) of another program.
        selection: What of it.
        known: Definitions for what the bag does not define itself.

    Raises:
        BagError: The bag cannot be read, or nothing of it is selected: one line.
    """
    path = Path(path)
    source = open_source(path, known)
    for name in (*selection.remap, *selection.replaced):
        if name not in source.topics:
            raise BagError(f"{path}: holds no topic {name!r}, expected one of {' '.join(source.topics):.200}")
    chosen = {name: topic for name, topic in source.topics.items() if selection.topics.accepts(name)}
    left_out = {name: topic.fault for name, topic in chosen.items() if topic.fault}
    start_ns = source.start_ns + round(selection.start_offset_sec * 1e9)
    end_ns = source.end_ns
    if selection.duration_sec is not None:
        end_ns = min(end_ns, start_ns + round(selection.duration_sec * 1e9))
    if not chosen or not any(topic.count for topic in chosen.values()):
        raise BagError(
            f"{path}: nothing to play: no message on the topics chosen out of {' '.join(source.topics):.200}"
        )
    if start_ns > source.end_ns:
        length_sec = (source.end_ns - source.start_ns) * 1e-9
        raise BagError(f"{path}: start offset {selection.start_offset_sec:g} s, expected at most its {length_sec:g} s")
    topics = {name: topic for name, topic in chosen.items() if name not in left_out}
    return Playback(
        path=path,
        topics=topics,
        left_out=left_out,
        counts={name: topic.count for name, topic in chosen.items()},
        names={name: selection.remap.get(name, _on_the_wire(name)) for name in topics},
        start_ns=start_ns,
        end_ns=end_ns,
        attachments=source.attachments,
        _source=source,
        _replaced=dict(selection.replaced),
    )


def _on_the_wire(name: str) -> str:
    """Topic on which messages were that a bag keeps apart, because it does not tell publishers apart."""
    return name.removesuffix(f"/{SECOND_PUBLISHER}")
