"""Monitors for the streams of a mapping: rows of foreign numbers -> received samples -> conclusions."""

from collections.abc import Mapping as MappingType
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from math import isfinite, nan
from pathlib import Path
from typing import NamedTuple

from bags.foreign.fields import FieldPath
from bags.foreign.mapping import Mapping, Signal, StreamMapping, stream_widths
from bags.foreign.sampling import Row, Values
from bags.mcap.errors import BagError
from bags.watch.designs import design_run, said_of
from bags.watch.histories import read_histories
from bags.wire.convert import history_of
from bags.wire.records import DesignRecord, HistoryRecord
from bags.wire.row import Widths
from bags.wire.schema import RunTopics, run_topics
from dgu_sim.grid import Link
from dgu_sim.records import Sample
from monitor.combined import DguMonitor, DguState, Received
from monitor.history import History
from monitor.linear import Component
from monitor.link_monitor import MonitorOutput
from monitor.settings import MonitorSettings

_SAME_PERIOD = 1e-3  # relative


def padded(vector: Sequence[Component], width: int) -> tuple[Component, ...]:
    """A vector with NaN for what it lacks."""
    return (*vector, *(nan,) * width)[:width]


class Place(NamedTuple):
    """Where a signal is in a row, and what makes SI units of it."""

    track: int
    position: int
    factor: float
    offset: float

    def value(self, values: Values) -> float:
        """The signal in SI units."""
        return values[self.position] * self.factor + self.offset


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamReader:
    """Takes the sample of one link out of a row.

    Attributes:
        link: The link.
        y: Outputs.
        u: Known inputs.
        widths: Of the vectors of all streams; NaN stands for what this one does not send.
        delivered: 0 where the sample was lost, None: nothing says so.
    """

    link: Link
    y: tuple[Place, ...]
    u: tuple[Place, ...]
    widths: Widths
    delivered: Place | None

    def sample(self, row: Row) -> Sample:
        """The received output; not delivered where any part of it is missing or no finite number."""
        places = (*self.y, *self.u, *([] if self.delivered is None else [self.delivered]))
        numbers: list[float] = []
        arrived = True
        for place in places:
            values = row.values[place.track]
            numbers.append(nan if values is None else place.value(values))
            arrived = arrived and isfinite(numbers[-1])
        if self.delivered is not None:
            arrived = numbers.pop() != 0.0 and arrived
        y, u = numbers[: len(self.y)], numbers[len(self.y) :]
        return Sample(y=padded(y, self.widths.outputs), delivered=arrived, u=padded(u, self.widths.inputs))


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamMonitors:
    """Observers and detectors of all links of a mapping, in the order of `topics.links`.

    Attributes:
        topics: Links and T_s.
        fields: Fields of each track, by its topic, in the order of a row.
        readers: Take samples out of rows.
        monitors: Take the samples of the links into one DGU each.
        designs: What was designed.
        histories: From what.
    """

    topics: RunTopics
    fields: MappingType[str, tuple[FieldPath, ...]]
    readers: tuple[StreamReader, ...]
    monitors: tuple[DguMonitor, ...]
    designs: tuple[DesignRecord, ...]
    histories: tuple[HistoryRecord, ...]

    def init(self) -> tuple[DguState, ...]:
        """State before the first row."""
        return tuple(monitor.init() for monitor in self.monitors)

    def step(
        self, states: Sequence[DguState], row: Row
    ) -> tuple[tuple[DguState, ...], list[tuple[Sample, MonitorOutput]]]:
        """Take one row: what each link received, and what its monitor concludes."""
        samples = [reader.sample(row) for reader in self.readers]
        received = iter([Received(tuple(one.y), one.delivered, tuple(one.u)) for one in samples])
        stepped = [
            monitor.step(state, list(islice(received, len(monitor.links))))
            for monitor, state in zip(self.monitors, states, strict=True)
        ]
        outputs = [
            one._replace(estimate=padded(tuple(one.estimate), self.topics.widths.states))
            for _, said in stepped
            for one in said.links
        ]
        return tuple(state for state, _ in stepped), list(zip(samples, outputs, strict=True))

    def not_finite(self, row: Row) -> list[FieldPath]:
        """The fields that came with a row, and are no finite numbers."""
        came = zip(self.fields.values(), row.values, strict=True)
        return [
            path
            for paths, values in came
            if values is not None
            for path, value in zip(paths, values, strict=True)
            if not isfinite(value)
        ]


def stream_monitors(mapping: Mapping, source: str, history: Path) -> StreamMonitors:
    """Design a monitor for every stream of a mapping.

    Args:
        mapping: Its `streams`, `monitor` and `sampling_period_sec`.
        source: What to call it in messages.
        history: Bag with a history of every watched DGU.

    Raises:
        BagError: No streams, wrong fields, no history of a DGU, or one that does not fit: one line.
        monitor.errors.MonitorError: Unknown observer or detector, or options of theirs.
    """
    if not mapping.streams:
        raise BagError(f"{source}: the mapping has no key streams, expected what to monitor")
    streams = {one.ends: one for one in mapping.streams}
    ends = sorted({end for link in streams for end in (link.source, link.target)})
    records = {dgu: read_histories(history, dgu) for dgu in sorted({link.source for link in streams})}
    histories = {dgu: history_of(found) for dgu, found in records.items()}
    period_sec = _period_sec(mapping, source, history, histories)
    widths = stream_widths(mapping.streams, max(one.states for one in histories.values()))
    topics = run_topics(ends, list(streams), round(period_sec * 1e9), widths=widths)
    fields = _fields(source, mapping.streams)
    for link, one in streams.items():
        _check_fits(source, one, link, histories[link.source])
    alone = MonitorSettings(observer=mapping.monitor.observer, detector=mapping.monitor.detector)
    with said_of(source):
        designs = design_run(topics, alone, histories)
        designs.check_start()
    return StreamMonitors(
        topics=topics,
        fields=fields,
        readers=tuple(_reader(streams[link], fields, widths) for link in topics.links),
        monitors=designs.monitors,
        designs=tuple(record for _, record in designs.messages()),
        histories=tuple(record for found in records.values() for record in found),
    )


def _period_sec(mapping: Mapping, source: str, history: Path, histories: MappingType[int, History]) -> float:
    recorded = {dgu: one.sampling_period_sec for dgu, one in histories.items()}
    wanted = mapping.sampling_period_sec or next(iter(recorded.values()))
    for dgu, period_sec in recorded.items():
        if abs(period_sec / wanted - 1.0) > _SAME_PERIOD:
            raise BagError(
                f"{history}: the history of DGU {dgu} is sampled every {period_sec:g} s, expected {wanted:g} s as "
                f"{source} or another history says"
            )
    return wanted


def _check_fits(source: str, stream: StreamMapping, link: Link, history: History) -> None:
    if len(stream.y) != history.outputs:
        raise BagError(
            f"{source}: stream {stream.link} has {len(stream.y)} outputs y, expected {history.outputs} as the history "
            f"of DGU {link.source} has"
        )
    if len(stream.u) != history.inputs:
        raise BagError(
            f"{source}: stream {stream.link} has {len(stream.u)} known inputs u, expected {history.inputs} as the "
            f"history of DGU {link.source} has"
        )


def _fields(source: str, streams: Sequence[StreamMapping]) -> dict[str, tuple[FieldPath, ...]]:
    """Fields by topic, each once, in the order in which the mapping names them."""
    found: dict[str, dict[str, FieldPath]] = {}
    for signal in (signal for one in streams for signal in one.signals):
        try:
            path = FieldPath.parse(signal.field)
        except BagError as error:
            raise BagError(f"{source}: {error}") from None
        found.setdefault(path.topic, {})[str(path)] = path
    return {topic: tuple(paths.values()) for topic, paths in found.items()}


def _reader(stream: StreamMapping, fields: MappingType[str, tuple[FieldPath, ...]], widths: Widths) -> StreamReader:
    tracks = list(fields)

    def place(signal: Signal) -> Place:
        path = FieldPath.parse(signal.field)
        return Place(tracks.index(path.topic), fields[path.topic].index(path), signal.factor, signal.offset)

    return StreamReader(
        link=stream.ends,
        y=tuple(place(signal) for signal in stream.y),
        u=tuple(place(signal) for signal in stream.u),
        widths=widths,
        delivered=place(stream.delivered) if stream.delivered else None,
    )
