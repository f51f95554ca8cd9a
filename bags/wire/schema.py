"""Every recorded topic of a run, in canonical order.

The order is the order of the messages of one step in a bag and of the channels in its file: so a run in processes,
composed, or offline leaves the same messages in the same order. Per-step messages come first, then the events of
that step; latched messages stand before step 0.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import final

from bags.mcap.cdr import Layout, layout_of
from bags.mcap.topic import Topic, TopicKind
from bags.wire.codecs import AlarmCodec, ClockCodec, OutputCodec, ResidualCodec, StateCodec, TickCodec
from bags.wire.combined_topics import CombinedTopics, Parts
from bags.wire.documents import AttackEventCodec, DesignCodec, DiagnosticsCodec, HistoryCodec
from bags.wire.stream import StreamCodec
from bags.wire.team_topics import TeamTopics
from dgu_sim.grid import Link
from dgu_sim.scenario import Scenario
from dgu_sim.settings import MonitorSettings

CLOCK_NODE = "clock"
ATTACKER_NODE = "attacker"
SECOND_PUBLISHER = "second_publisher"


def dgu_name(dgu: int) -> str:
    """Name of a DGU and of its node: `dgu_1`."""
    return f"dgu_{dgu}"


def monitor_name(dgu: int) -> str:
    """Name of the monitor node on a DGU: `monitor_1`."""
    return f"monitor_{dgu}"


@final
@dataclass(frozen=True, kw_only=True)
class RunTopics:
    """The topics of a run and their codecs.

    Attributes:
        dgus: DGU numbers, ascending.
        links: Directed communication links, ordered by (target, source).
        sampling_period_ns: T_s [ns].
        has_team: Whether the monitors estimate the whole grid together.
        parts: What the monitors tell besides their residuals; None: nothing.
    """

    dgus: tuple[int, ...]
    links: tuple[Link, ...]
    sampling_period_ns: int
    has_team: bool = False

    @cached_property
    def team(self) -> TeamTopics | None:
        """The topics of the team, if there is one."""
        if not self.has_team:
            return None
        return TeamTopics(dgus=self.dgus, links=self.links, sampling_period_ns=self.sampling_period_ns)

    parts: Parts | None = None

    @cached_property
    def combined(self) -> CombinedTopics | None:
        """The topics of monitors that draw one conclusion from several tests, if they do."""
        if self.parts is None:
            return None
        return CombinedTopics(
            links=self.links, monitors=self.monitors, sampling_period_ns=self.sampling_period_ns, parts=self.parts
        )

    @property
    def monitors(self) -> tuple[int, ...]:
        """The DGUs that receive something, ascending: each hosts a monitor."""
        return tuple(dgu for dgu in self.dgus if self.sources(dgu))

    def sources(self, monitor: int) -> tuple[int, ...]:
        """The DGUs that a DGU receives from, ascending."""
        return tuple(link.source for link in self.links if link.target == monitor)

    @cached_property
    def all(self) -> tuple[Topic, ...]:
        """Every recorded topic in canonical order."""
        events = [self.alarms(dgu).topic for dgu in self.monitors]
        events += [self.stream(dgu).topic for dgu in self.monitors]
        events += [self.attack_events().topic, self._diagnostics_topic()]
        latched = [self.history(dgu).topic for dgu in self.dgus] + [self.design(link).topic for link in self.links]
        if self.combined is not None:
            latched += self.combined.latched
        if self.team is not None:
            events, latched = [*events, *self.team.events], [*latched, *self.team.latched]
        return (*self.per_step, *events, *latched)

    @cached_property
    def per_step(self) -> tuple[Topic, ...]:
        """The topics with exactly one message at every step, in canonical order."""
        return (
            self.clock().topic,
            self.tick().topic,
            *(self.state(dgu).topic for dgu in self.dgus),
            *(self.output(dgu).topic for dgu in self.dgus),
            *(() if self.combined is None else self.combined.sent),
            *(self.received(link).topic for link in self.links),
            *(self.residual(link).topic for link in self.links),
            *(() if self.combined is None else self.combined.concluded),
            *(() if self.team is None else self.team.per_step),
        )

    @cached_property
    def heard(self) -> tuple[Topic, ...]:
        """The topics that a bag of received outputs has at every step, whoever recorded them, in canonical order."""
        return (self.clock().topic, self.tick().topic, *(self.received(link).topic for link in self.links))

    def published_by(self, node: str) -> tuple[Topic, ...]:
        """The recorded topics that one node publishes."""
        return tuple(topic for topic in self.all if node in topic.publishers)

    def stamp_ns(self, step: int) -> int:
        """Stamp of step k [ns]."""
        return step * self.sampling_period_ns

    def clock(self) -> ClockCodec:
        """Simulated time on /clock."""
        topic, layout = _fixed("/clock", "rosgraph_msgs/msg/Clock", CLOCK_NODE)
        return ClockCodec(topic=topic, layout=layout, period_ns=self.sampling_period_ns)

    def tick(self) -> TickCodec:
        """Step release on /tick."""
        topic, layout = _fixed("/tick", "dcmg_msgs/msg/Tick", CLOCK_NODE)
        return TickCodec(topic=topic, layout=layout, period_ns=self.sampling_period_ns)

    def state(self, dgu: int) -> StateCodec:
        """Ground truth of a DGU."""
        topic, layout = _fixed(f"/dgu_{dgu}/state", "dcmg_msgs/msg/State", dgu_name(dgu), dgu_name(dgu))
        return StateCodec(topic=topic, layout=layout, period_ns=self.sampling_period_ns, dgu=dgu)

    def output(self, dgu: int) -> OutputCodec:
        """Output of a DGU as sent."""
        topic, layout = _fixed(f"/dgu_{dgu}/output", "dcmg_msgs/msg/Output", dgu_name(dgu), dgu_name(dgu))
        return OutputCodec(topic=topic, layout=layout, period_ns=self.sampling_period_ns, source=dgu)

    def received(self, link: Link) -> OutputCodec:
        """Output of a DGU as received over a link."""
        name = f"/dgu_{link.target}/received/dgu_{link.source}"
        topic, layout = _fixed(name, "dcmg_msgs/msg/Output", ATTACKER_NODE, dgu_name(link.source))
        return OutputCodec(topic=topic, layout=layout, period_ns=self.sampling_period_ns, source=link.source)

    def second(self, link: Link) -> OutputCodec:
        """What another publisher sent on the topic of `received(link)`, kept beside it in a bag.

        On the wire these messages are on `/dgu_j/received/dgu_i` like all others; a bag does not tell publishers
        apart, so it has a topic for them, announced with the first one.
        """
        received = self.received(link)
        topic = replace(received.topic, name=f"{received.topic.name}/{SECOND_PUBLISHER}", kind=TopicKind.EVENT)
        return replace(received, topic=topic)

    def residual(self, link: Link) -> ResidualCodec:
        """What the monitor on the link's target concludes."""
        name = f"/dgu_{link.target}/residual/dgu_{link.source}"
        topic, layout = _fixed(name, "dcmg_msgs/msg/Residual", monitor_name(link.target), dgu_name(link.target))
        return ResidualCodec(
            topic=topic,
            layout=layout,
            period_ns=self.sampling_period_ns,
            source=link.source,
            monitor=link.target,
        )

    def alarms(self, monitor: int) -> AlarmCodec:
        """Starting and ending alarms of a monitor."""
        topic, layout = _fixed(
            f"/dgu_{monitor}/alarms",
            "dcmg_msgs/msg/Alarm",
            monitor_name(monitor),
            dgu_name(monitor),
            kind=TopicKind.EVENT,
        )
        return AlarmCodec(topic=topic, layout=layout, period_ns=self.sampling_period_ns, monitor=monitor)

    def stream(self, monitor: int) -> StreamCodec:
        """Appearing and ending faults of the streams into a DGU."""
        topic = Topic(
            name=f"/dgu_{monitor}/stream",
            type_name="dcmg_msgs/msg/StreamEvent",
            publishers=(monitor_name(monitor),),
            kind=TopicKind.EVENT,
        )
        return StreamCodec(topic=topic, period_ns=self.sampling_period_ns, monitor=monitor)

    def attack_events(self) -> AttackEventCodec:
        """Starting and ending attacks."""
        topic = Topic(
            name="/attacks/events",
            type_name="dcmg_msgs/msg/AttackEvent",
            publishers=(ATTACKER_NODE,),
            kind=TopicKind.EVENT,
        )
        return AttackEventCodec(topic=topic, period_ns=self.sampling_period_ns)

    def diagnostics(self, monitor: int) -> DiagnosticsCodec:
        """Health of a monitor's links, once per simulated second."""
        return DiagnosticsCodec(
            topic=self._diagnostics_topic(),
            period_ns=self.sampling_period_ns,
            monitor=monitor,
            sources=self.sources(monitor),
        )

    def history(self, dgu: int) -> HistoryCodec:
        """Offline experiments of a DGU."""
        topic = _latched(f"/dgu_{dgu}/history", "dcmg_msgs/msg/History", dgu_name(dgu))
        return HistoryCodec(topic=topic, dgu=dgu)

    def design(self, link: Link) -> DesignCodec:
        """Observer designed for a link."""
        name = f"/dgu_{link.target}/design/dgu_{link.source}"
        topic = _latched(name, "dcmg_msgs/msg/Design", monitor_name(link.target))
        return DesignCodec(topic=topic, source=link.source, monitor=link.target)

    def _diagnostics_topic(self) -> Topic:
        return Topic(
            name="/diagnostics",
            type_name="diagnostic_msgs/msg/DiagnosticArray",
            publishers=tuple(monitor_name(dgu) for dgu in self.monitors),
            kind=TopicKind.EVENT,
        )


def run_topics(
    dgus: Sequence[int],
    links: Sequence[Link],
    sampling_period_ns: int,
    *,
    team: bool = False,
    parts: Parts | None = None,
) -> RunTopics:
    """The topics of a run; DGUs and links are put into canonical order."""
    return RunTopics(
        dgus=tuple(sorted(dgus)),
        links=tuple(sorted(links, key=lambda link: (link.target, link.source))),
        sampling_period_ns=sampling_period_ns,
        has_team=team,
        parts=parts,
    )


def topics_of(scenario: Scenario) -> RunTopics:
    """The topics of a scenario's run."""
    team, parts = scenario.monitor.team is not None, parts_of(scenario.monitor)
    return run_topics(scenario.grid.dgus, scenario.links, scenario.sampling_period_ns, team=team, parts=parts)


def parts_of(settings: MonitorSettings) -> Parts | None:
    """What monitors tell besides their residuals; None: nothing."""
    parts = Parts(local=settings.local is not None, inputs=settings.plausibility is not None)
    return parts if settings.combined else None


def _fixed(
    name: str, type_name: str, node: str, frame_id: str = "", kind: TopicKind = TopicKind.PER_STEP
) -> tuple[Topic, Layout]:
    layout = layout_of(type_name, frame_id)
    return Topic(name=name, type_name=type_name, publishers=(node,), kind=kind, layout=layout), layout


def _latched(name: str, type_name: str, node: str) -> Topic:
    return Topic(name=name, type_name=type_name, publishers=(node,), kind=TopicKind.LATCHED)
