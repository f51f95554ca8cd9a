"""The monitor of one DGU, designed from recorded data alone: hears, guards, steps and tells."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from bags.wire.schema import monitor_name
from bags.wire.stream import claimed_step
from dcmg_nodes.inbox import Inbox
from dcmg_nodes.intake import Intake, taken
from dcmg_nodes.ports import Ports
from dcmg_nodes.second_publisher import SecondPublisherReaders
from dcmg_nodes.stream_watch import StreamWatch
from dcmg_nodes.team_side import TeamSide
from dcmg_nodes.watch_side import WatchSide
from monitor.combined import Received

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bags.watch.designs import Told
    from dcmg_nodes.host import Host
    from dcmg_nodes.intake import Others
    from dcmg_nodes.wiring import Wiring
    from monitor.link_monitor import MonitorOutput


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitorConfig:
    """What a monitor is told besides data.

    Attributes:
        told: what it runs.
        steps: number of steps of the run.
        newest: whether the newest of two messages of one step counts, or that of the known publisher.
    """

    told: Told
    steps: int
    newest: bool


class MonitorNode:
    """Fires step k when the received outputs of all incoming links, and the own sample if it counts, are in."""

    def __init__(self, wiring: Wiring, host: Host, dgu: int, config: MonitorConfig) -> None:
        """Subscribe to the histories of the neighbours and to what arrives from them."""
        self.ports = Ports(monitor_name(dgu), wiring, host)
        self._config = config
        topics = wiring.topics
        links = [link for link in topics.links if link.target == dgu]
        self._received = [topics.received(link) for link in links]
        self._alarm_codec, self._diagnostics = topics.alarms(dgu), topics.diagnostics(dgu)
        self._stream_codec, self._streams = topics.stream(dgu), StreamWatch(self._received)
        self._alarms = [False] * (len(links) + 1)
        self._step = 0
        self._side = WatchSide(self.ports, topics, dgu, config.told, self._alarm)
        names = [codec.topic.name for codec in self._received]
        if self._side.own is not None:
            names.append(self._side.own.topic.name)
            self.ports.subscribe(self._side.own.topic, lambda data: self._receive(len(links), data, None))
        self._inbox: Inbox[tuple[bytes, Others | None]] = Inbox(names)
        self.ports.waits_for(self._inbox.missing)
        expect = {}
        for slot, (link, codec) in enumerate(zip(links, self._received, strict=True)):
            intake = Intake(partial(claimed_step, codec), partial(self._receive, slot))
            self.ports.subscribe(codec.topic, intake.push, intake.push_other)
            expect[link] = intake.expect
        self._seconds = SecondPublisherReaders(self.ports, links, expect)
        self._team: TeamSide | None = None
        if topics.team is not None and wiring.plan is not None:
            team = (wiring.plan, config.told)
            self._team = TeamSide(self.ports, topics.output(dgu), topics.team, team, self._finish_when_done)
        self.ports.ready_when(lambda: self._side.ready and (not self._team or self._team.ready))

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
        samples = [codec.decode(data)[1] for codec, data in zip(self._received, received, strict=True)]
        outputs = self._side.step(
            self._step,
            [Received(tuple(sample.y), sample.delivered, tuple(sample.u)) for sample in samples],
            None if self._side.own is None else tokens[-1][0],
            self._streams.faults,
        )
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

    def _alarm(self, slot: int, source: int, output: MonitorOutput) -> None:
        if output.alarm != self._alarms[slot]:
            self._alarms[slot] = bool(output.alarm)
            alarm = self._alarm_codec.encode(self._step, source, output)
            self.ports.publish(self._alarm_codec.topic.name, alarm)
