"""One distributed generation unit: physics and secondary control of DGU i."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from bags.wire.row import Need
from bags.wire.schema import dgu_name
from bags.wire.stream import claimed_step
from dcmg_nodes.announcer import Announcer
from dcmg_nodes.inbox import Inbox
from dcmg_nodes.intake import Intake, taken
from dcmg_nodes.ports import Ports
from dcmg_nodes.second_publisher import SecondPublisherReaders
from dgu_sim.grid import Link
from dgu_sim.records import Sample, heard
from monitor.combined import Own

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bags.wire.records import HistoryRecord
    from dcmg_nodes.host import Host
    from dcmg_nodes.intake import Others
    from dcmg_nodes.wiring import Wiring
    from dgu_sim.unit import Unit


@dataclass(frozen=True, slots=True, kw_only=True)
class DguConfig:
    """What a DGU is told besides its unit.

    Attributes:
        steps: number of steps of the run.
        newest: whether it takes the newest of two messages of one step, or that of the known publisher.
    """

    steps: int
    newest: bool


class DguNode:
    """Fires step k on tick k and, of k-1, physical states, received outputs and the verdict, if it responds to one."""

    def __init__(
        self, wiring: Wiring, host: Host, unit: Unit, history: Sequence[HistoryRecord], config: DguConfig
    ) -> None:
        """Publish the unit's offline experiments and subscribe to what its step needs."""
        self.ports = Ports(dgu_name(unit.dgu), wiring, host)
        self._unit = unit
        self._state = unit.init()
        self._step = 0
        self._config = config
        topics = wiring.topics
        self._physical = [topics.state(dgu) for dgu in unit.physical]
        links = [Link(source, unit.dgu) for source in unit.neighbours]
        self._received = [topics.received(link) for link in links]
        inputs = [topics.tick().topic, *(codec.topic for codec in self._physical)]
        names = [topic.name for topic in inputs] + [codec.topic.name for codec in self._received]
        combined = topics.combined if links else None
        self._own = combined.own(unit.dgu) if combined is not None and topics.has(Need.LOCAL) else None
        self._verdict = combined.verdict(unit.dgu) if combined is not None and wiring.responds else None
        if self._verdict is not None:
            names.append(self._verdict.topic.name)
            self.ports.subscribe(self._verdict.topic, partial(self._receive, len(names) - 1))
        self._inbox: Inbox[bytes] = Inbox(names, primed=frozenset(names[1:]))
        self.ports.waits_for(self._inbox.missing)
        for slot, topic in enumerate(inputs):
            self.ports.subscribe(topic, partial(self._receive, slot))
        expect = {}
        for slot, (link, codec) in enumerate(zip(links, self._received, strict=True), start=len(inputs)):
            intake = Intake(partial(claimed_step, codec), partial(self._take, slot))
            self.ports.subscribe(codec.topic, intake.push, intake.push_other)
            expect[link] = intake.expect
        self._seconds = SecondPublisherReaders(self.ports, links, expect)
        self._state_codec, self._output_codec = topics.state(unit.dgu), topics.output(unit.dgu)
        told = topics.history(unit.dgu)
        for experiment in history:
            self.ports.publish(told.topic.name, told.encode(experiment))
        self.announcer: Announcer | None = None
        if topics.team is not None and wiring.plan is not None:
            self.announcer = Announcer(self.ports, topics.team, unit.dgu, wiring.plan)

    def _take(self, slot: int, own: bytes, others: Others | None) -> None:
        self._receive(slot, taken(own, others, newest=self._config.newest))

    def _receive(self, slot: int, data: bytes) -> None:
        tokens = self._inbox.push(slot, data)
        while tokens is not None:
            self._fire(tokens)
            tokens = self._inbox.take()

    def _fire(self, tokens: Sequence[bytes | None]) -> None:
        if self._step:
            _tick, *inputs = tokens
            states, samples = inputs[: len(self._physical)], inputs[len(self._physical) :]
            physical = [codec.decode(data)[1] for codec, data in zip(self._physical, states, strict=True) if data]
            received = [codec.decode(data)[1] for codec, data in zip(self._received, samples, strict=False) if data]
            if self._verdict is not None and samples[-1] is not None:
                received = heard(received, self._verdict.decode(samples[-1])[1].dropped)
            self._state = self._unit.step(self._state, physical, received)
        output = self._unit.output(self._state)
        self.ports.publish(self._state_codec.topic.name, self._state_codec.encode(self._step, output))
        self.ports.publish(self._output_codec.topic.name, self._output_codec.encode(self._step, Sample(y=output.y)))
        if self._own is not None:
            own = Own(tuple(output.y), output.reference)
            self.ports.publish(self._own.topic.name, self._own.encode(self._step, own))
        if self.announcer is not None:
            self.announcer.announce(self._step, output)
        self._step += 1
        if self._step == self._config.steps:
            self.ports.finish()
