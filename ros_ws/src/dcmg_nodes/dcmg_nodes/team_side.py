"""A monitor node's part in a team: estimates of the whole grid out and in."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from bags.watch.team import run_team
from bags.watch.team_record import accusation
from bags.wire.convert import history_of
from dcmg_nodes.inbox import Inbox

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from bags.mcap.topic import Topic
    from bags.watch.designs import Told
    from bags.wire.codecs import StepCodec
    from bags.wire.records import HistoryRecord
    from bags.wire.schema import RunTopics
    from dcmg_nodes.ports import Ports
    from monitor.team import Member, MemberOutput, MemberState, TeamPlan


class TeamSide:
    """Fires step k on the outputs of step k that it measures, and what was announced and told at k-1."""

    def __init__(
        self,
        ports: Ports,
        own: StepCodec,
        topics: RunTopics,
        told: tuple[TeamPlan, Told],
        finished: Callable[[], None],
    ) -> None:
        """Subscribe to the grid's history, the own output, announced inputs and the neighbours' estimates."""
        dgu = own.source
        plan, self._told = told
        self._ports, self._plan, self._dgu, self._finished, self._topics = ports, plan, dgu, finished, topics
        self._own, self._heard = own, plan.heard[dgu]
        self._inputs = [topics.announced(other) for other in plan.unheard(dgu)]
        self._estimates = [topics.estimate(other) for other in plan.neighbours(dgu)]
        self._history, self._design = topics.grid_history(), topics.team_design(dgu)
        self._estimate, self._alarm_codec = topics.estimate(dgu), topics.accusations(dgu)
        self._experiments: list[HistoryRecord] = []
        self._member: Member | None = None
        self._state: MemberState | None = None
        self._accused = (False,) * len(plan.members)
        self.step = 0
        later = [codec.topic for codec in self._inputs] + [codec.topic for codec in self._estimates]
        names = [f"output of DGU {other}" for other in self._heard] + [topic.name for topic in later]
        self._inbox: Inbox[bytes] = Inbox(names, primed=frozenset(names[len(self._heard) :]))
        self._subscribe(self._heard.index(dgu), self._own.topic)
        for slot, topic in enumerate(later, start=len(self._heard)):
            self._subscribe(slot, topic)
        ports.subscribe(self._history.topic, self._receive_history)

    @property
    def ready(self) -> bool:
        """Whether the team is designed."""
        return self._member is not None

    def hear(self, received: Sequence[bytes]) -> None:
        """Take what the node received from its neighbours at one step, in the order of the links."""
        slots = [slot for slot, other in enumerate(self._heard) if other != self._dgu]
        for slot, data in zip(slots, received, strict=True):
            self._receive(slot, data)

    def _subscribe(self, slot: int, topic: Topic) -> None:
        self._ports.subscribe(topic, partial(self._receive, slot))

    def _receive_history(self, data: bytes) -> None:
        self._experiments.append(self._history.decode(data))
        if len(self._experiments) != self._experiments[0].experiments:
            return
        told = (self._plan, history_of(self._experiments))
        designed = run_team(self._topics, self._told.settings, told, self._told.carried)
        record = designed.record(self._dgu)
        if not record.accepted:
            reason = f"no team: {record.verdict}"
            self._ports.log.warning(reason)
        self._member = designed.team.members[self._plan.members.index(self._dgu)]
        self._state = self._member.init()
        self._ports.publish(self._design.topic.name, self._design.encode(record))

    def _receive(self, slot: int, data: bytes) -> None:
        tokens = self._inbox.push(slot, data)
        while tokens is not None:
            self._fire(tokens)
            tokens = self._inbox.take()

    def _fire(self, tokens: Sequence[bytes | None]) -> None:
        assert self._member is not None  # noqa: S101 - the clock waits until every node is ready
        assert self._state is not None  # noqa: S101 - idem
        outputs = [self._own.decode(data)[1].y for data in tokens[: len(self._heard)] if data]
        before = tokens[len(self._heard) :]
        announced = [codec.decode(data)[1] for codec, data in zip(self._inputs, before, strict=False) if data]
        told = [
            codec.decode(data)[1].told if data else None
            for codec, data in zip(self._estimates, before[len(self._inputs) :], strict=True)
        ]
        y = [float(component) for output in outputs for component in output]
        self._state, output = self._member.step(self._state, y, self._plan.told(announced), told)
        self._ports.publish(self._estimate.topic.name, self._estimate.encode(self.step, output))
        self._accuse(output)
        self.step += 1
        self._finished()

    def _accuse(self, output: MemberOutput) -> None:
        """Tell of accusations that start or end."""
        for at, (now, before) in enumerate(zip(output.alarm, self._accused, strict=True)):
            if now != before:
                data = self._alarm_codec.encode(self.step, self._plan.members[at], accusation(output, at))
                self._ports.publish(self._alarm_codec.topic.name, data)
        self._accused = output.alarm
