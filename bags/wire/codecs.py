"""Fixed-length messages: records of the simulator and the monitors <-> bytes on the wire.

Nodes, the offline simulation and the reader all go through these, so their bytes cannot differ. A codec holds the
topic and the constant numbers of its messages; steps become stamps of `step * period_ns` nanoseconds.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from bags.mcap.cdr import Layout
from bags.mcap.topic import NANOSECONDS_PER_SECOND, Topic
from bags.wire.forms import NOTHING, width_of
from bags.wire.records import AlarmRecord
from bags.wire.row import Form, Spot
from dgu_sim.grid import Link
from monitor.link_monitor import MonitorOutput


def stamp_of(step: int, period_ns: int) -> tuple[int, int]:
    """Seconds and nanoseconds of step k: k T_s since the start of the run."""
    return divmod(step * period_ns, NANOSECONDS_PER_SECOND)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockCodec:
    """`rosgraph_msgs/msg/Clock` on /clock."""

    topic: Topic
    layout: Layout
    period_ns: int

    @classmethod
    def at(cls, spot: Spot) -> "ClockCodec":
        """The codec of a row at a place."""
        return cls(topic=spot.topic, layout=spot.layout, period_ns=spot.period_ns)

    def encode(self, step: int) -> bytes:
        """Bytes of step k."""
        return self.layout.pack(*stamp_of(step, self.period_ns))

    def decode(self, data: bytes) -> int:
        """Simulated time [ns]."""
        sec, nanosec = self.layout.unpack(data)
        return int(sec) * NANOSECONDS_PER_SECOND + int(nanosec)


@dataclass(frozen=True, slots=True, kw_only=True)
class StepCodec:
    """Messages with a header, a step, numbers that never change, and a record.

    Attributes:
        topic: The topic.
        layout: Of its messages.
        period_ns: T_s [ns].
        place: The link, or twice the DGU.
        numbers: What never changes, in the order of the message.
        form: Of the record.
        links: Number of links into the DGU that listens.
    """

    topic: Topic
    layout: Layout
    period_ns: int
    place: Link
    numbers: tuple[int, ...]
    form: Form
    links: int
    _made: Callable[[tuple[Any, ...]], Any] = field(init=False, repr=False, compare=False)

    @classmethod
    def at(cls, spot: Spot) -> "StepCodec":
        """The codec of a row at a place."""
        return cls(
            topic=spot.topic,
            layout=spot.layout,
            period_ns=spot.period_ns,
            place=spot.place,
            numbers=spot.numbers,
            form=spot.form or NOTHING,
            links=len(spot.sources),
        )

    def __post_init__(self) -> None:
        """Look up once what depends on the widths of the run."""
        object.__setattr__(self, "_made", self.form.made(self.layout, self.links))

    @property
    def source(self) -> int:
        """The DGU that the messages are about."""
        return self.place.source

    @property
    def monitor(self) -> int:
        """The DGU that hosts who concludes."""
        return self.place.target

    def encode(self, step: int, *record: Any) -> bytes:  # noqa: ANN401 - whatever the row's form takes
        """Bytes of step k."""
        return self.layout.pack(*stamp_of(step, self.period_ns), step, *self.numbers, *self.form.flat(*record))

    def decode(self, data: bytes) -> tuple[int, Any]:
        """Step and record."""
        found = self.layout.unpack(data)
        return found[2], self._made(found[3 + len(self.numbers) :])

    def claims(self, data: bytes) -> tuple[int, int, bool]:
        """Step and source that an output claims, and whether it holds a sample."""
        _, _, step, source, delivered, *_ = self.layout.unpack(data)
        return step, source, delivered


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmCodec:
    """`dcmg_msgs/msg/Alarm`: an alarm of one monitor starts or ends."""

    topic: Topic
    layout: Layout
    period_ns: int
    monitor: int

    @classmethod
    def at(cls, spot: Spot) -> "AlarmCodec":
        """The codec of a row at a place."""
        return cls(topic=spot.topic, layout=spot.layout, period_ns=spot.period_ns, monitor=spot.place.target)

    def encode_record(self, alarm: AlarmRecord) -> bytes:
        """Bytes of an alarm."""
        stamp = stamp_of(alarm.step, self.period_ns)
        told = (alarm.step, alarm.source, self.monitor, alarm.active)
        return self.layout.pack(*stamp, *told, *alarm.residual, *alarm.threshold)

    def encode(self, step: int, source: int, output: MonitorOutput) -> bytes:
        """Bytes for a verdict that changed at step k on the link from `source`."""
        return self.encode_record(alarm_of(step, source, self.monitor, output))

    def decode(self, data: bytes) -> AlarmRecord:
        """The alarm."""
        _, _, step, source, monitor, active, *numbers = self.layout.unpack(data)
        p = width_of(self.layout, "residual")
        return AlarmRecord(
            step=step,
            source=source,
            monitor=monitor,
            active=active,
            residual=tuple(numbers[:p]),
            threshold=tuple(numbers[p:]),
        )


def alarm_of(step: int, source: int, monitor: int, output: MonitorOutput) -> AlarmRecord:
    """The alarm of a verdict that changed at step k."""
    return AlarmRecord(
        step=step,
        source=source,
        monitor=monitor,
        active=bool(output.alarm),
        residual=tuple(map(float, output.residual)),
        threshold=tuple(map(float, output.threshold)),
    )
