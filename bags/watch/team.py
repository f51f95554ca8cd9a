"""A whole team at once, as the offline simulation and the replay need it.

Every member steps with floats through the same `Member.step` as in its node, fed with the same numbers.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bags.watch.carried import Carried
from bags.watch.team_checks import team_links
from bags.watch.team_record import TeamArrays
from bags.wire.documents import DesignCodec
from bags.wire.records import GRID, DesignRecord
from bags.wire.schema import RunTopics
from bags.wire.settings import settings_of
from dgu_sim.scenario import Scenario
from dgu_sim.signals import first_step
from monitor.history import History
from monitor.settings import AnnouncedInput, MonitorSettings, TeamEventKind
from monitor.team import Lie, MemberOutput, MemberState, Presence, Team, TeamPlan, carried_team, design_team

OBSERVER = "distributed"
_JUDGED_BY = ("settle_sec", "calibrate_sec", "margin", "floor", "isolate")


@dataclass(frozen=True, slots=True, kw_only=True)
class RunTeam:
    """The team of a run.

    Attributes:
        topics: Its topics.
        plan: Who is in it.
        team: What runs.
    """

    topics: RunTopics
    plan: TeamPlan
    team: Team

    def messages(self) -> list[tuple[DesignCodec, DesignRecord]]:
        """What the members say about their design before step 0."""
        return [(self.topics.team_design(member), self.record(member)) for member in self.plan.members]

    def record(self, member: int) -> DesignRecord:
        """The design of the team as one member tells it."""
        return DesignRecord(
            source=GRID,
            monitor=member,
            observer=OBSERVER,
            accepted=self.team.accepted,
            verdict=self.team.verdict,
            certificate=self.team.documents[self.plan.members.index(member)],
        )

    def init(self) -> tuple[tuple[MemberState, ...], TeamArrays]:
        """States before step 0, and the nothing that came before."""
        return tuple(member.init() for member in self.team.members), TeamArrays.empty(self.topics, 1)

    def run(
        self,
        before: tuple[tuple[MemberState, ...], TeamArrays],
        y: NDArray[np.float64],
        received: NDArray[np.float64],
        inputs: NDArray[np.float64],
    ) -> tuple[tuple[tuple[MemberState, ...], TeamArrays], TeamArrays]:
        """Take consecutive steps.

        Args:
            before: States, and what was told up to now (the last row counts).
            y: Outputs as sent, shape (steps, dgus, 3).
            received: Outputs as received, NaN where not delivered, shape (steps, links, 3).
            inputs: Announced inputs, shape (steps, announcing DGUs, 2).

        Returns:
            The same for the next call, and what was told.
        """
        states, earlier = before
        arrays = TeamArrays.empty(self.topics, len(y))
        arrays.inputs[:] = inputs
        told = [earlier.at(-1, at) for at in range(len(states))]
        announced = earlier.inputs[-1].tolist()
        own, incoming, following = y.tolist(), received.tolist(), inputs.tolist()
        for row in range(len(y)):
            stepped = [
                member.step(state, *self._fed(at, own[row], incoming[row], announced, told))
                for at, (member, state) in enumerate(zip(self.team.members, states, strict=True))
            ]
            states, told, announced = tuple(one for one, _ in stepped), [two for _, two in stepped], following[row]
            for at, output in enumerate(told):
                arrays.put(row, at, output)
        return (states, arrays), arrays

    def _fed(
        self,
        at: int,
        own: Sequence[Sequence[float]],
        received: Sequence[Sequence[float]],
        announced: Sequence[Sequence[float]],
        told: Sequence[MemberOutput],
    ) -> tuple[list[float], list[float], list[tuple[float, ...] | None]]:
        """What one member gets at one step, from what all have."""
        member = self.plan.members[at]
        y: list[float] = []
        for dgu in self.plan.heard[member]:
            y += own[at] if dgu == member else received[self._link(dgu, member)]
        known = self.plan.told([announced[self.topics.announcing.index(dgu)] for dgu in self.plan.unheard(member)])
        return y, known, [told[self.plan.members.index(other)].told for other in self.plan.neighbours(member)]

    def _link(self, source: int, target: int) -> int:
        return next(at for at, one in enumerate(self.topics.links) if (one.source, one.target) == (source, target))


def plan_of(scenario: Scenario, topics: RunTopics) -> TeamPlan:
    """What the members are told besides data."""
    team = settings_of(scenario).team
    if team is None:
        raise ValueError(f"scenario {scenario.name} has no monitor.team")

    def step(time_sec: float) -> int:
        return first_step(time_sec, scenario.sampling_period_sec)

    comings = [one for one in team.events if one.kind is not TeamEventKind.LIES]
    presence = [Presence(step(one.start_sec), one.member, one.kind is TeamEventKind.JOINS) for one in comings]
    lies = tuple(
        Lie(one.member, step(one.start_sec), None if one.stop_sec is None else step(one.stop_sec), one.bias)
        for one in team.events
        if one.bias is not None
    )
    told_load, told_reference = (one in team.announced for one in AnnouncedInput)
    return TeamPlan(
        members=topics.dgus,
        heard={member: topics.hears(member) for member in topics.dgus},
        links=team_links(scenario, team),
        announced=(told_load, told_reference),
        structure=team.structure.value,
        leader=team.leader,
        chi=team.coupling,
        sampling_period_sec=scenario.sampling_period_sec,
        detector={name: getattr(team, name) for name in ("settle_sec", "calibrate_sec", "margin", "floor")},
        isolate=team.isolate,
        presence=tuple(sorted(presence)),
        lies=lies,
    )


def run_team(
    topics: RunTopics, settings: MonitorSettings, told: tuple[TeamPlan, History], carried: Carried | None = None
) -> RunTeam:
    """The team of a run: as it is carried, or designed from a record of the whole grid.

    Args:
        topics: Its topics.
        settings: What the monitors run.
        told: Who is in it, and the record.
        carried: Designs that are taken as they are where they were made with the same settings and are complete.

    Raises:
        monitor.errors.MonitorError: The record is of another grid.
    """
    plan, history = told
    team = None
    if carried is not None:
        codec = topics.team_design(plan.members[0])
        records = [carried.records.get(topics.team_design(member).topic.name) for member in plan.members]
        documents = [record.certificate for record in records if record is not None]
        if len(documents) == len(records):
            team = carried.take(
                codec, settings, _designed_by, lambda record: carried_team(plan, record.verdict, documents)
            )
    return RunTeam(topics=topics, plan=plan, team=team or design_team(plan, history).team)


def _designed_by(settings: MonitorSettings) -> object:
    """What of the settings the design of a team depends on: not how its members judge one another."""
    return settings.team and settings.team.model_copy(update=dict.fromkeys(_JUDGED_BY))
