"""One distributed generation unit: physics and secondary control of DGU i."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from bags.schema import dgu_name
from dcmg_nodes.announcer import Announcer
from dcmg_nodes.inbox import Inbox
from dcmg_nodes.ports import Ports
from dgu_sim.grid import Link
from dgu_sim.records import Sample

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bags.records import HistoryRecord
    from dcmg_nodes.host import Host
    from dcmg_nodes.wiring import Wiring
    from dgu_sim.unit import Unit


class DguNode:
    """Fires step k on tick k, the physical states of k-1 and the received outputs of k-1."""

    def __init__(self, wiring: Wiring, host: Host, unit: Unit, history: Sequence[HistoryRecord], steps: int) -> None:
        """Publish the unit's offline experiments and subscribe to what its step needs."""
        self.ports = Ports(dgu_name(unit.dgu), wiring, host)
        self._unit = unit
        self._state = unit.init()
        self._step = 0
        self._steps = steps
        topics = wiring.topics
        self._physical = [topics.state(dgu) for dgu in unit.physical]
        self._received = [topics.received(Link(source, unit.dgu)) for source in unit.neighbours]
        inputs = [topics.tick().topic]
        inputs += [codec.topic for codec in self._physical] + [codec.topic for codec in self._received]
        names = [topic.name for topic in inputs]
        self._inbox: Inbox[bytes] = Inbox(names, primed=frozenset(names[1:]))
        for slot, topic in enumerate(inputs):
            self.ports.subscribe(topic, partial(self._receive, slot))
        self._state_codec, self._output_codec = topics.state(unit.dgu), topics.output(unit.dgu)
        codec = topics.history(unit.dgu)
        for experiment in history:
            self.ports.publish(codec.topic.name, codec.encode(experiment))
        self.announcer: Announcer | None = None
        if topics.team is not None and wiring.plan is not None:
            self.announcer = Announcer(self.ports, topics.team, unit.dgu, wiring.plan)

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
            received = [codec.decode(data)[1] for codec, data in zip(self._received, samples, strict=True) if data]
            self._state = self._unit.step(self._state, physical, received)
        output = self._unit.output(self._state)
        self.ports.publish(self._state_codec.topic.name, self._state_codec.encode(self._step, output))
        self.ports.publish(self._output_codec.topic.name, self._output_codec.encode(self._step, Sample(y=output.y)))
        if self.announcer is not None:
            self.announcer.announce(self._step, output)
        self._step += 1
        if self._step == self._steps:
            self.ports.finish()
