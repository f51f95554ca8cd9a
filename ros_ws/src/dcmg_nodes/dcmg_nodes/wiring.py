"""Who publishes and who subscribes: the static graph of a run, from which every node knows when it is fully matched."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from typing import TYPE_CHECKING

from bags.watch.team import plan_of
from bags.wire.row import Need, named
from bags.wire.schema import ATTACKER_NODE, CLOCK_NODE, dgu_name, monitor_name, topics_of
from bags.wire.settings import settings_of
from dgu_sim.errors import ScenarioError
from dgu_sim.unit import unit_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from bags.mcap.topic import Topic
    from bags.wire.schema import RunTopics
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
        run: which run it is: in words, and a digest of the whole scenario. Nodes of another one do not fit.
    """

    topics: RunTopics
    physical: Mapping[int, Sequence[int]]
    plan: TeamPlan | None = None
    responds: bool = False
    run: str = ""

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
        topics, found = self.topics, {}
        for row in topics.present:
            for place in topics.places(row.over):
                readers = (name for pattern in row.readers for name in named(pattern, place, self._related))
                found[topics.topic(row, place).name] = tuple(readers)
        return found

    def _related(self, relation: str, dgu: int) -> Sequence[int]:
        """DGUs in a relation of the table of messages to one."""
        topics, plan = self.topics, self.plan
        related: dict[str, Callable[[], Sequence[int]]] = {
            "all": lambda: topics.dgus,
            "coupled": lambda: [other for other in topics.dgus if dgu in self.physical[other]],
            "hearing": lambda: [link.target for link in topics.links if link.source == dgu],
            "hosting": lambda: [dgu] if topics.has(Need.LOCAL) and dgu in topics.monitors else (),
            "responding": lambda: [dgu] if self.responds else (),
            "member": lambda: [dgu] if plan else (),
            "unaware": lambda: topics.unaware(dgu),
            "neighbours": lambda: plan.neighbours(dgu) if plan else (),
        }
        return related[relation]()


def wiring_of(scenario: Scenario) -> Wiring:
    """Return the static graph of a scenario's run.

    Raises:
        ScenarioError: the scenario has a script, which only a simulation obeys.
    """
    if scenario.script:
        raise ScenarioError(
            f"{scenario.name}: script: {len(scenario.script)} commands, expected none in a run over ROS 2, whose nodes "
            "do not obey them yet: dcmg simulate does"
        )
    dgus = tuple(dgu.id for dgu in scenario.dgus)
    topics = topics_of(scenario)
    digest = sha256(scenario.to_yaml().encode()).hexdigest()
    return Wiring(
        topics=topics,
        physical={dgu: unit_of(scenario, dgu).physical for dgu in dgus},
        plan=None if topics.team is None else plan_of(scenario, topics.team),
        responds=settings_of(scenario).response is not None,
        run=f"{scenario.name}, seed {scenario.seed}, {scenario.steps} steps, digest {digest[:12]}",
    )
