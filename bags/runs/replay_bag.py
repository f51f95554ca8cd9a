"""A replayed run as a bag: what the fresh monitors conclude in the place of what the recorded ones did.

All other messages are copied. So a replay with the settings of the run gives the messages of the run, byte for byte.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from bags.mcap.container import open_container
from bags.mcap.errors import BagError
from bags.mcap.topic import Topic, TopicKind
from bags.mcap.writer import BagWriter
from bags.runs.conclusions import concluded_events, concluded_rows, designed, diagnosed
from bags.runs.playback import Moment, Selection, open_playback
from bags.runs.run_record import RunRecord
from bags.wire.arrays import columns
from bags.wire.schema import SECOND_PUBLISHER, RunTopics
from monitor.stream_guard import Faults, StreamFault

_CHUNK_BYTES = 1024 * 1024
_REPLAY_OF = "replay_of"  # in the custom data of metadata.yaml


def write_replayed(
    path: Path, windows: Iterable[RunRecord], histories: Mapping[str, Sequence[bytes]]
) -> Iterator[RunRecord]:
    """Pass the windows of a replayed run on, and write them as a bag on the way.

    Args:
        path: The bag's directory; must not exist.
        windows: What `replay_windows` gives.
        histories: Messages of histories other than the run's, by topic.

    Raises:
        BagError: The bag cannot be written; the run lacks a message that the fresh monitors would have sent anew.
    """
    writing: _Writing | None = None
    try:
        for window in windows:
            writing = writing or _open(path, window, histories)
            writing.add(window)
            yield window
    finally:
        if writing is not None:
            writing.writer.close()


@dataclass(slots=True, kw_only=True)
class _Writing:
    """A bag on its way from the recorded messages to the replayed ones."""

    writer: BagWriter
    topics: RunTopics
    latched: Mapping[str, bytes]
    moments: Iterator[Moment]
    whole: bool  # a run, not a stream from outside: every topic has a message at every step
    waiting: Moment | None = None
    faults: dict[tuple[int, int], set[str]] = field(default_factory=dict)

    def add(self, window: RunRecord) -> None:
        """Write the steps of a window."""
        rows = concluded_rows(window)
        events: dict[int, list[tuple[Topic, bytes]]] = {}
        for step, topic, data in concluded_events(window):
            events.setdefault(step, []).append((topic, data))
        while (moment := self.waiting or next(self.moments, None)) is not None:
            step = moment.time_ns // self.topics.sampling_period_ns
            self.waiting = moment if step >= window.end_step else None
            if self.waiting is not None:
                return
            said = {name: messages[step - window.first_step].tobytes() for name, messages in rows.items()}
            for one in (one for one in window.streams if one.step == step):
                active = self.faults.setdefault((one.source, one.monitor), set())
                (active.add if one.active else active.discard)(one.kind)
            self._write_step(moment, said)
            self._write_events(moment, [*events.get(step, ()), *diagnosed(window, step, self._faults())])

    def _write_step(self, moment: Moment, said: Mapping[str, bytes]) -> None:
        """Write latched and per-step messages, in canonical order."""
        found: dict[str, list[bytes]] = {}
        for name, data in moment.messages:
            found.setdefault(name, []).append(data)
        for topic in self.topics.all:
            if topic.kind is not TopicKind.LATCHED:
                continue
            recorded = found.get(topic.name, [])
            anew = topic.name in self.latched and (recorded or not (self.whole or moment.time_ns))
            for data in [self.latched[topic.name]] if anew else recorded:
                self.writer.write(topic.name, moment.time_ns, data)
        for topic in self.topics.per_step:
            data = said.get(topic.name) or next(iter(found.get(topic.name, ())), b"")
            if data:
                self.writer.write(topic.name, moment.time_ns, data)
            elif self.whole:
                raise BagError(f"{self.writer.path}: {topic.name} was not recorded, expected a message of every step")

    def _write_events(self, moment: Moment, told: Sequence[tuple[Topic, bytes]]) -> None:
        """Write the other messages of a step: those of second publishers, then in canonical order."""
        copied = {topic.name: topic for topic in self.topics.all if topic.kind is TopicKind.EVENT}
        ranks = {name: rank for rank, name in enumerate(copied)}
        again = {name for name, topic in copied.items() if topic.type_name in _TOLD_AGAIN}
        kept = [(name, data) for name, data in moment.messages if name in copied and name not in again]
        seconds = [(name, data) for name, data in moment.messages if name.endswith(f"/{SECOND_PUBLISHER}")]
        events = sorted([*kept, *((topic.name, data) for topic, data in told)], key=lambda one: ranks[one[0]])
        for name, data in [*seconds, *events]:
            if name not in self.writer.counts:
                self.writer.add_topic(_second(self.topics, name))
            self.writer.write(name, moment.time_ns, data)

    def _faults(self) -> dict[tuple[int, int], Faults]:
        """What is wrong with each link's stream, in the order in which a guard says it."""
        return {link: tuple(one for one in StreamFault if one in active) for link, active in self.faults.items()}


_TOLD_AGAIN = ("dcmg_msgs/msg/Alarm", "diagnostic_msgs/msg/DiagnosticArray")


def _open(path: Path, window: RunRecord, histories: Mapping[str, Sequence[bytes]]) -> _Writing:
    playback = open_playback(window.path, Selection(replaced=histories))
    whole = bool(window.scenario_text)
    there = set(open_container(window.path).topics) | {
        one.topic.name for one in columns(window.topics, window.arrays) if one.row.publisher.startswith("monitor_")
    }
    writer = BagWriter(
        path,
        [one for one in window.topics.all if whole or one.kind is not TopicKind.PER_STEP or one.name in there],
        chunk_bytes=_CHUNK_BYTES,
        max_chunk_age_sec=None,
        custom_data={_REPLAY_OF: str(window.path)},
    )
    for name, data in window.attachments.items():
        writer.attach(name, data)
    return _Writing(
        writer=writer,
        topics=window.topics,
        latched=designed(window),
        moments=playback.moments(),
        whole=whole,
    )


def _second(topics: RunTopics, name: str) -> Topic:
    """The topic that keeps what a second publisher sent."""
    return next(topic for topic in (topics.second(link).topic for link in topics.links) if topic.name == name)
