"""Fixed-length messages: records of the simulator and the monitors <-> bytes on the wire.

Nodes, the offline simulation and the reader all go through these, so their bytes cannot differ. A codec holds the
topic and the constant numbers of its messages; steps become stamps of `step * period_ns` nanoseconds.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

from bags.mcap.cdr import Layout
from bags.mcap.topic import Topic
from bags.wire.records import AlarmRecord
from dgu_sim.records import Physical, Sample
from monitor.link_monitor import MonitorOutput

if TYPE_CHECKING:
    from dgu_sim.unit import UnitOutput

NANOSECONDS_PER_SECOND = 1_000_000_000


def stamp_of(step: int, period_ns: int) -> tuple[int, int]:
    """Seconds and nanoseconds of step k: k T_s since the start of the run."""
    return divmod(step * period_ns, NANOSECONDS_PER_SECOND)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ClockCodec:
    """`rosgraph_msgs/msg/Clock` on /clock."""

    topic: Topic
    layout: Layout
    period_ns: int

    def encode(self, step: int) -> bytes:
        """Bytes of step k."""
        return self.layout.pack(*stamp_of(step, self.period_ns))

    def decode(self, data: bytes) -> int:
        """Simulated time [ns]."""
        sec, nanosec = self.layout.unpack(data)
        return int(sec) * NANOSECONDS_PER_SECOND + int(nanosec)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TickCodec:
    """`dcmg_msgs/msg/Tick` on /tick."""

    topic: Topic
    layout: Layout
    period_ns: int

    def encode(self, step: int) -> bytes:
        """Bytes of step k."""
        return self.layout.pack(*stamp_of(step, self.period_ns), step)

    def decode(self, data: bytes) -> int:
        """The step."""
        _, _, step = self.layout.unpack(data)
        return int(step)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class StateCodec:
    """`dcmg_msgs/msg/State`: ground truth of one DGU."""

    topic: Topic
    layout: Layout
    period_ns: int
    dgu: int

    def encode(self, step: int, output: "UnitOutput") -> bytes:
        """Bytes of step k."""
        return self.layout.pack(
            *stamp_of(step, self.period_ns),
            step,
            self.dgu,
            *output.x,
            output.load_current,
            output.reference,
            output.alpha,
        )

    def decode(self, data: bytes) -> tuple[int, Physical]:
        """Step and what a coupled DGU may know."""
        _, _, step, _, V, I_t, v, load_current, reference, _ = self.layout.unpack(data)
        return step, Physical(x=(V, I_t, v), load_current=load_current, reference=reference)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class OutputCodec:
    """`dcmg_msgs/msg/Output`: an output as sent or as received."""

    topic: Topic
    layout: Layout
    period_ns: int
    source: int

    def encode(self, step: int, sample: Sample) -> bytes:
        """Bytes of step k."""
        return self.layout.pack(*stamp_of(step, self.period_ns), step, self.source, sample.delivered, *sample.y)

    def claims(self, data: bytes) -> tuple[int, int, bool]:
        """Step and source that the message claims, and whether it holds a sample."""
        _, _, step, source, delivered, *_ = self.layout.unpack(data)
        return step, source, delivered

    def decode(self, data: bytes) -> tuple[int, Sample]:
        """Step and sample."""
        _, _, step, _, delivered, V, I_t, v = self.layout.unpack(data)
        return step, Sample(y=(V, I_t, v), delivered=delivered)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ResidualCodec:
    """`dcmg_msgs/msg/Residual`: what a monitor concludes from one incoming link."""

    topic: Topic
    layout: Layout
    period_ns: int
    source: int
    monitor: int

    def encode(self, step: int, output: MonitorOutput) -> bytes:
        """Bytes of step k."""
        return self.layout.pack(
            *stamp_of(step, self.period_ns),
            step,
            self.source,
            self.monitor,
            output.phase,
            output.alarm,
            *output.estimate,
            *output.residual,
            *output.threshold,
        )

    def decode(self, data: bytes) -> tuple[int, MonitorOutput]:
        """Step and verdict."""
        _, _, step, _, _, phase, alarm, *numbers = self.layout.unpack(data)
        return step, MonitorOutput(
            phase=phase, alarm=alarm, estimate=numbers[:3], residual=numbers[3:6], threshold=numbers[6:]
        )


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmCodec:
    """`dcmg_msgs/msg/Alarm`: an alarm of one monitor starts or ends."""

    topic: Topic
    layout: Layout
    period_ns: int
    monitor: int

    def encode_record(self, alarm: AlarmRecord) -> bytes:
        """Bytes of an alarm."""
        stamp = stamp_of(alarm.step, self.period_ns)
        told = (alarm.step, alarm.source, self.monitor, alarm.active)
        return self.layout.pack(*stamp, *told, *alarm.residual, *alarm.threshold)

    def encode(self, step: int, source: int, output: MonitorOutput) -> bytes:
        """Bytes for a verdict that changed at step k on the link from `source`."""
        return self.layout.pack(
            *stamp_of(step, self.period_ns),
            step,
            source,
            self.monitor,
            output.alarm,
            *output.residual,
            *output.threshold,
        )

    def decode(self, data: bytes) -> AlarmRecord:
        """The alarm."""
        _, _, step, source, monitor, active, *numbers = self.layout.unpack(data)
        return AlarmRecord(
            step=step,
            source=source,
            monitor=monitor,
            active=active,
            residual=tuple(numbers[:3]),
            threshold=tuple(numbers[3:]),
        )
