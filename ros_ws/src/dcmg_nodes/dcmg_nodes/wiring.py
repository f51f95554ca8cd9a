"""Who publishes and who subscribes: the static graph of a run, from which every node knows when it is fully matched."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from bags.watch.team import plan_of
from bags.wire.schema import ATTACKER_NODE, CLOCK_NODE, dgu_name, monitor_name, topics_of
from dgu_sim.unit import unit_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from bags.mcap.topic import Topic
    from bags.wire.combined_topics import CombinedTopics
    from bags.wire.schema import RunTopics
    from bags.wire.team_topics import TeamTopics
    from dgu_sim.scenario import Scenario
    from monitor.team import TeamPlan

RECORDER_NODE = "recorder"
SECOND, SECOND_MATCHED = "/run/second_publisher", "/run/second_publisher_matched"
READY, PROGRESS, PACING, DONE, END = "/run/ready", "/run/progress", "/run/pacing", "/run/done", "/run/end"


@dataclass(frozen=True, kw_only=True)
class Wiring:
    """Static graph of a run.

    Attributes:
        topics: all recorded topics, in canonical order.
        physical: for each DGU the DGUs whose state message it needs.
        plan: the team of monitors, if there is one.
        responds: whether each DGU waits for what its monitor concludes.
    """

    topics: RunTopics
    physical: Mapping[int, Sequence[int]]
    plan: TeamPlan | None = None
    responds: bool = False

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of all nodes of the run."""
        return (
            CLOCK_NODE,
            *(dgu_name(dgu) for dgu in self.topics.dgus),
            ATTACKER_NODE,
            *(monitor_name(dgu) for dgu in self.topics.monitors),
            RECORDER_NODE,
        )

    def readers(self, topic: Topic) -> tuple[str, ...]:
        """Names of the nodes that subscribe to a recorded topic."""
        return (*self._consumers.get(topic.name, ()), RECORDER_NODE)

    def warm_up(self) -> None:
        """Compute what every node needs, so that forked processes share it."""
        for topic in self.topics.all:
            self.readers(topic)

    @cached_property
    def _consumers(self) -> Mapping[str, tuple[str, ...]]:
        topics = self.topics
        readers = {topics.tick().topic.name: tuple(dgu_name(dgu) for dgu in topics.dgus)}
        for dgu in topics.dgus:
            readers[topics.state(dgu).topic.name] = tuple(
                dgu_name(other) for other in topics.dgus if dgu in self.physical[other]
            )
            readers[topics.output(dgu).topic.name] = (ATTACKER_NODE,)
            readers[topics.history(dgu).topic.name] = tuple(
                monitor_name(link.target) for link in topics.links if link.source == dgu
            )
        for link in topics.links:
            readers[topics.received(link).topic.name] = (dgu_name(link.target), monitor_name(link.target))
        if topics.team is not None and self.plan is not None:
            readers |= _team_readers(topics, topics.team, self.plan)
        if topics.combined is not None:
            readers |= self._combined_consumers(topics.combined, readers)
        return readers

    def _combined_consumers(
        self, topics: CombinedTopics, readers: Mapping[str, tuple[str, ...]]
    ) -> dict[str, tuple[str, ...]]:
        """Who reads what the parts of a monitor that draws one conclusion need, and its verdict."""
        found: dict[str, tuple[str, ...]] = {}
        for dgu in topics.monitors:
            if topics.parts.local:
                history = self.topics.history(dgu).topic.name
                found[topics.own(dgu).topic.name] = (monitor_name(dgu),)
                found[history] = (*readers[history], monitor_name(dgu))
            if self.responds:
                found[topics.verdict(dgu).topic.name] = (dgu_name(dgu),)
        return found


def wiring_of(scenario: Scenario) -> Wiring:
    """Return the static graph of a scenario's run."""
    dgus = tuple(dgu.id for dgu in scenario.dgus)
    topics = topics_of(scenario)
    return Wiring(
        topics=topics,
        physical={dgu: unit_of(scenario, dgu).physical for dgu in dgus},
        plan=None if topics.team is None else plan_of(scenario, topics.team),
        responds=scenario.monitor.response is not None,
    )


def _team_readers(topics: RunTopics, team: TeamTopics, plan: TeamPlan) -> dict[str, tuple[str, ...]]:
    """Return who else reads what when the monitors are a team."""
    readers = {team.history().topic.name: tuple(monitor_name(member) for member in plan.members)}
    for dgu in team.announcing:
        readers[team.inputs(dgu).topic.name] = tuple(monitor_name(member) for member in team.unaware(dgu))
    for member in plan.members:
        readers[topics.output(member).topic.name] = (ATTACKER_NODE, monitor_name(member))
        readers[team.estimate(member).topic.name] = tuple(monitor_name(other) for other in plan.neighbours(member))
    return readers
