"""The monitors of one DGU: an observer and a detector for every incoming link, designed from recorded data alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from bags.convert import design_record, history_of
from bags.schema import monitor_name
from bags.stream import claimed_step
from dcmg_nodes.combined_side import CombinedSide
from dcmg_nodes.inbox import Inbox
from dcmg_nodes.intake import Intake, taken
from dcmg_nodes.ports import Ports
from dcmg_nodes.second_publisher import SecondPublisherReaders
from dcmg_nodes.stream_watch import StreamWatch
from dcmg_nodes.team_side import TeamSide
from monitor import detectors, observers
from monitor.combined import Received
from monitor.link_monitor import LinkMonitor

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from bags.records import HistoryRecord
    from dcmg_nodes.host import Host
    from dcmg_nodes.intake import Others
    from dcmg_nodes.wiring import Wiring
    from monitor.combined import CombinedPlan
    from monitor.link_monitor import MonitorOutput, MonitorState


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitorConfig:
    """What a monitor is told besides data.

    Attributes:
        observer: name of the design method, with its options.
        detector: name of the detector, with its options.
        sampling_period_sec: T_s [s].
        steps: number of steps of the run.
        newest: whether the newest of two messages of one step counts, or that of the known publisher.
        combined: what to run when the monitor draws one conclusion from several tests.
    """

    observer: tuple[str, Mapping[str, object]]
    detector: tuple[str, Mapping[str, object]]
    sampling_period_sec: float
    steps: int
    newest: bool
    combined: CombinedPlan


class MonitorNode:
    """Fires step k when the received outputs of all incoming links for step k are in."""

    def __init__(self, wiring: Wiring, host: Host, dgu: int, config: MonitorConfig) -> None:
        """Subscribe to the histories of the neighbours and to what arrives from them."""
        self.ports = Ports(monitor_name(dgu), wiring, host)
        self._config = config
        topics = wiring.topics
        links = [link for link in topics.links if link.target == dgu]
        self._received = [topics.received(link) for link in links]
        self._residuals = [topics.residual(link) for link in links]
        self._histories = [topics.history(link.source) for link in links]
        self._designs = [topics.design(link) for link in links]
        self._alarm_codec, self._diagnostics = topics.alarms(dgu), topics.diagnostics(dgu)
        self._stream_codec, self._streams = topics.stream(dgu), StreamWatch(self._received)
        self._experiments: list[list[HistoryRecord]] = [[] for _ in links]
        self._monitors: dict[int, LinkMonitor] = {}
        self._states: dict[int, MonitorState] = {}
        self._alarms = [False] * (len(links) + 1)
        self._step = 0
        self._combined: CombinedSide | None = None
        names = [codec.topic.name for codec in self._received]
        if topics.combined is not None:
            self._combined = CombinedSide(self.ports, topics, dgu, config.combined, self._alarm)
            if self._combined.own is not None:
                names.append(self._combined.own.topic.name)
                self.ports.subscribe(self._combined.own.topic, lambda data: self._receive(len(links), data, None))
        self._inbox: Inbox[tuple[bytes, Others | None]] = Inbox(names)
        expect = {}
        for slot, (link, codec) in enumerate(zip(links, self._received, strict=True)):
            intake = Intake(partial(claimed_step, codec), partial(self._receive, slot))
            self.ports.subscribe(codec.topic, intake.push, intake.push_other)
            expect[link] = intake.expect
            if self._combined is None:
                self.ports.subscribe(self._histories[slot].topic, partial(self._receive_history, slot))
        self._seconds = SecondPublisherReaders(self.ports, links, expect)
        self._team: TeamSide | None = None
        if topics.team is not None and wiring.plan is not None:
            self._team = TeamSide(self.ports, topics.output(dgu), topics.team, wiring.plan, self._finish_when_done)
        self.ports.ready_when(self._prepared)

    def _prepared(self) -> bool:
        designed = len(self._monitors) == len(self._received) if self._combined is None else self._combined.ready
        return designed and (not self._team or self._team.ready)

    def _receive_history(self, slot: int, data: bytes) -> None:
        experiments = self._experiments[slot]
        experiments.append(self._histories[slot].decode(data))
        if len(experiments) == experiments[0].experiments:
            self._design(slot)

    def _design(self, slot: int) -> None:
        codec = self._designs[slot]
        kind, options = self._config.observer
        design = observers.design(kind, history_of(self._experiments[slot]), options)
        if not design.accepted:
            reason = f"link {codec.source}-{codec.monitor} is not monitored: {design.verdict}"
            self.ports.log.warning(reason)
        detector = detectors.build(*self._config.detector, self._config.sampling_period_sec)
        self._monitors[slot] = LinkMonitor(
            observer=design.observer, detector=detector, channels=design.channels, blind=design.blind
        )
        self._states[slot] = self._monitors[slot].init()
        record = design_record(design, codec.source, codec.monitor)
        self.ports.publish(codec.topic.name, codec.encode(record))

    def _receive(self, slot: int, own: bytes, others: Others | None) -> None:
        tokens = self._inbox.push(slot, (own, others))
        while tokens is not None:
            self._fire([token for token in tokens if token is not None])
            tokens = self._inbox.take()

    def _fire(self, tokens: Sequence[tuple[bytes, Others | None]]) -> None:
        arrived = tokens[: len(self._received)]
        for slot, (own, others) in enumerate(arrived):
            self._guard(slot, own, others)
        received = [taken(own, others, newest=self._config.newest) for own, others in arrived]
        outputs: Sequence[MonitorOutput]
        if self._combined is None:
            outputs = [self._watch(slot, data) for slot, data in enumerate(received)]
        else:
            decoded = [codec.decode(data)[1] for codec, data in zip(self._received, received, strict=True)]
            samples = [Received(tuple(sample.y), sample.delivered) for sample in decoded]
            own_sample = None if self._combined.own is None else tokens[-1][0]
            outputs = self._combined.step(self._step, samples, own_sample, self._streams.faults)
        if self._diagnostics.due(self._step):
            health = self._diagnostics.encode(self._step, outputs, self._streams.faults)
            self.ports.publish(self._diagnostics.topic.name, health)
        self._step += 1
        if self._team is not None:
            self._team.hear(received)
        else:
            self._finish_when_done()

    def _finish_when_done(self) -> None:
        if self._step == self._config.steps and (not self._team or self._team.step == self._config.steps):
            self.ports.finish()

    def _guard(self, slot: int, own: bytes, others: Others | None) -> None:
        codec = self._stream_codec
        for change in self._streams.look(slot, self._step, own, others):
            self.ports.publish(codec.topic.name, codec.encode(self._step, self._received[slot].source, change))

    def _watch(self, slot: int, data: bytes) -> MonitorOutput:
        _, sample = self._received[slot].decode(data)
        y = tuple(sample.y)
        self._states[slot], output = self._monitors[slot].step(self._states[slot], y, sample.delivered)
        codec = self._residuals[slot]
        self._alarm(slot, codec.source, output)
        self.ports.publish(codec.topic.name, codec.encode(self._step, output))
        return output

    def _alarm(self, slot: int, source: int, output: MonitorOutput) -> None:
        if output.alarm != self._alarms[slot]:
            self._alarms[slot] = bool(output.alarm)
            alarm = self._alarm_codec.encode(self._step, source, output)
            self.ports.publish(self._alarm_codec.topic.name, alarm)
