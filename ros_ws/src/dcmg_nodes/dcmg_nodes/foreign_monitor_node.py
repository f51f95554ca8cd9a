"""Monitors on topics that are not ours: any message types, sampled as a mapping says, without clock, tick or wiring."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from rclpy.node import Node

from dcmg_nodes.foreign_intake import ForeignIntake
from dcmg_nodes.ports import data_qos, message_class
from dcmg_nodes.stream_watch import StreamWatch

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rclpy.publisher import Publisher

    from bags.foreign.mapping import Mapping
    from bags.foreign.sampling import Row
    from bags.foreign.stream_monitors import StreamMonitors
    from bags.mcap.topic import Topic
    from bags.mcap.writer import BagWriter
    from dcmg_nodes.lifetime import Lifetime
    from monitor.link_monitor import MonitorOutput

NAME = "dcmg_monitor"


@dataclass(frozen=True, slots=True, kw_only=True)
class ForeignConfig:
    """What to monitor.

    Attributes:
        mapping: which numbers of which topics are what.
        monitors: designed for it.
        wait_sec: how long the topics are waited for [s].
        steps: ends after so many samples; None: never.
        writer: of the bag, None: nothing is recorded.
        say: called with every line that a person should read.
    """

    mapping: Mapping
    monitors: StreamMonitors
    wait_sec: float
    steps: int | None
    writer: BagWriter | None
    say: Callable[[str], None]


class ForeignMonitorNode:
    """Fires when a row of samples is complete, or has been waited for long enough."""

    def __init__(self, config: ForeignConfig, lifetime: Lifetime) -> None:
        """Publish the designs and begin to look for the topics."""
        self.node = Node(NAME, enable_rosout=False, start_parameter_services=False)
        self._config, self._lifetime = config, lifetime
        monitors, topics = config.monitors, config.monitors.topics
        self._monitors, self._topics = monitors, topics
        self._received = [topics.received(link) for link in topics.links]
        self._residuals = [topics.residual(link) for link in topics.links]
        self._diagnostics = [topics.diagnostics(dgu) for dgu in topics.monitors]
        self._streams = StreamWatch(self._received)
        self._publishers: dict[str, Publisher] = {}
        self._alarmed = [False] * len(topics.links)
        self._missed = [0] * len(topics.links)
        self._states = monitors.init()
        self.step, self.alarms, self.missing = 0, 0, 0
        self.not_finite: dict[str, int] = {}
        for link, record in zip(topics.links, monitors.designs, strict=True):
            codec = topics.design(link)
            self._publish(codec.topic, codec.encode(record))
        self.intake = ForeignIntake(
            self.node,
            config.mapping,
            monitors.fields,
            topics.sampling_period_ns,
            on_rows=self._conclude,
            on_failure=partial(lifetime.fail, NAME),
        )
        self._giving_up = self.node.create_timer(config.wait_sec, self._give_up)

    def _give_up(self) -> None:
        """End when a topic has not appeared."""
        self.node.destroy_timer(self._giving_up)
        missing = self.intake.missing()
        if missing and not self.step:
            found = ", ".join(self.intake.others()) or "no topic"
            reason = f"nobody published {missing[0]} within {self._config.wait_sec:g} s, found {found:.300}"
            self._lifetime.fail(NAME, reason)

    def _conclude(self, rows: Sequence[Row]) -> None:
        for row in rows:
            if self.step == self._config.steps:
                self._lifetime.leave(NAME)
                return
            self._fire(row)
            self.step += 1

    def _fire(self, row: Row) -> None:
        step = self.step
        clock, tick = self._topics.clock(), self._topics.tick()
        self._record(clock.topic, clock.encode(step))  # the bag counts steps; on the wire the time is not ours to tell
        self._record(tick.topic, tick.encode(step))
        self._states, found = self._monitors.step(self._states, row)
        received = [codec.encode(step, sample) for codec, (sample, _) in zip(self._received, found, strict=True)]
        outputs = [output for _, output in found]
        for slot, (sample, _) in enumerate(found):
            self._missed[slot] += not sample.delivered
            self.missing += not sample.delivered
        for path in self._monitors.not_finite(row):
            self.not_finite[str(path)] = self.not_finite.get(str(path), 0) + 1
        for codec, data in zip(self._received, received, strict=True):
            self._publish(codec.topic, data)
        for residual, output in zip(self._residuals, outputs, strict=True):
            self._publish(residual.topic, residual.encode(step, output))
        for slot, output in enumerate(outputs):
            self._tell(slot, received[slot], output)
        for health in self._diagnostics:
            if health.due(step):
                own = [slot for slot, link in enumerate(self._topics.links) if link.target == health.monitor]
                faults = self._streams.faults
                data = health.encode(step, [outputs[slot] for slot in own], faults and [faults[slot] for slot in own])
                self._publish(health.topic, data)

    def _tell(self, slot: int, received: bytes, output: MonitorOutput) -> None:
        """Publish and say what has changed on one link."""
        link, when = self._topics.links[slot], f"t = {self._topics.stamp_ns(self.step) * 1e-9:7.2f} s"
        if output.alarm != self._alarmed[slot]:
            self._alarmed[slot] = bool(output.alarm)
            self.alarms += self._alarmed[slot]
            codec = self._topics.alarms(link.target)
            self._publish(codec.topic, codec.encode(self.step, link.source, output))
            self._config.say(f"{when}  alarm on link {link}{'' if output.alarm else ' ends'}")
        for change in self._streams.look(slot, self.step, received, None):
            stream = self._topics.stream(link.target)
            self._publish(stream.topic, stream.encode(self.step, link.source, change))
        if self._missed[slot] and self._diagnostics[0].due(self.step + 1):  # once a second, not once a sample
            self._config.say(f"{when}  link {link}: {self._missed[slot]} samples missing in this second")
            self._missed[slot] = 0

    def _publish(self, topic: Topic, data: bytes) -> None:
        if topic.name not in self._publishers:
            kind = message_class(topic.type_name)
            self._publishers[topic.name] = self.node.create_publisher(kind, topic.name, data_qos(topic))
        self._publishers[topic.name].publish(data)
        self._record(topic, data)

    def _record(self, topic: Topic, data: bytes) -> None:
        if self._config.writer is not None:
            self._config.writer.write(topic.name, self._topics.stamp_ns(self.step), data)
