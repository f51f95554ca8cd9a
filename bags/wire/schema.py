"""The topics of a run: the rows of the table at the run's DGUs and links, each with its codec."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from bags.mcap.cdr import Layout, layout_of
from bags.mcap.errors import BagError
from bags.mcap.topic import Topic, TopicKind
from bags.mcap.typestore import Definitions
from bags.wire import table
from bags.wire.codecs import AlarmCodec, ClockCodec, StepCodec
from bags.wire.commands import CommandEventCodec
from bags.wire.documents import AttackEventCodec, DesignCodec, DiagnosticsCodec, HistoryCodec
from bags.wire.row import Codec_co, Need, Over, Row, Spot, Widths, at
from bags.wire.settings import settings_of
from bags.wire.stream import StreamCodec
from dgu_sim.commands import AttackCommand, Command
from dgu_sim.grid import Link
from dgu_sim.matrices import INPUTS, STATES

if TYPE_CHECKING:
    from dgu_sim.scenario import Scenario
    from monitor.settings import MonitorSettings

CLOCK_NODE, ATTACKER_NODE = table.CLOCK.publisher, table.RECEIVED.publisher
SECOND_PUBLISHER = "second_publisher"
DGU_WIDTHS = Widths(outputs=STATES, states=STATES, applied=INPUTS)
"""Of the DGUs that dgu_sim simulates: V, I_t, v; I_net + I_L, V_ref + alpha."""


def dgu_name(dgu: int) -> str:
    """Name of a DGU and of its node: `dgu_1`."""
    return f"dgu_{dgu}"


def monitor_name(dgu: int) -> str:
    """Name of the monitor node on a DGU: `monitor_1`."""
    return f"monitor_{dgu}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """What the monitors tell besides their residuals, when several tests draw one conclusion: a verdict always.

    Attributes:
        local: The own samples and the residual of the own state.
        inputs: The reconstructed inputs.
    """

    local: bool
    inputs: bool


@dataclass(frozen=True, kw_only=True)
class RunTopics:
    """The topics of a run and their codecs.

    Attributes:
        dgus: DGU numbers, ascending.
        links: Directed communication links, ordered by (target, source).
        sampling_period_ns: T_s [ns].
        has_team: Whether the monitors estimate the whole grid together.
        parts: What the monitors tell besides their residuals; None: nothing.
        widths: Of the vectors.
        definitions: Of types that the bag of the run lays out otherwise than we do.
        rows: The table.
    """

    dgus: tuple[int, ...]
    links: tuple[Link, ...]
    sampling_period_ns: int
    has_team: bool = False
    parts: Parts | None = None
    widths: Widths = DGU_WIDTHS
    definitions: Definitions = ()
    rows: tuple[Row[Any], ...] = field(default_factory=lambda: table.TABLE, repr=False)

    def has(self, need: Need) -> bool:
        """Whether the monitors do what a topic needs."""
        parts = self.parts
        there = {
            Need.ALWAYS: True,
            Need.COMBINED: parts is not None,
            Need.LOCAL: parts is not None and parts.local,
            Need.INPUTS: parts is not None and parts.inputs,
            Need.TEAM: self.has_team,
        }
        return there[need]

    @property
    def team(self) -> "RunTopics | None":
        """The topics, if there is a team."""
        return self if self.has_team else None

    @property
    def combined(self) -> "RunTopics | None":
        """The topics, if several tests draw one conclusion."""
        return self if self.parts is not None else None

    @property
    def monitors(self) -> tuple[int, ...]:
        """The DGUs that receive something, ascending: each hosts a monitor."""
        return tuple(dgu for dgu in self.dgus if self.sources(dgu))

    def sources(self, monitor: int) -> tuple[int, ...]:
        """The DGUs that a DGU receives from, ascending."""
        return tuple(link.source for link in self.links if link.target == monitor)

    @cached_property
    def announcing(self) -> tuple[int, ...]:
        """DGUs whose output some member of a team does not hear, ascending: they announce their inputs."""
        return tuple(dgu for dgu in self.dgus if self.unaware(dgu))

    def hears(self, member: int) -> tuple[int, ...]:
        """DGUs whose output a member of a team measures, ascending, itself included."""
        return tuple(sorted({member, *self.sources(member)}))

    def unaware(self, dgu: int) -> tuple[int, ...]:
        """Members of a team that do not hear a DGU, ascending."""
        return tuple(member for member in self.dgus if dgu not in self.hears(member))

    def places(self, over: Over) -> tuple[Link, ...]:
        """The links, or twice each DGU, that a row has a topic for: an axis of its arrays."""
        dgus = {
            Over.RUN: self.dgus[:1] or (0,),
            Over.DGUS: self.dgus,
            Over.MONITORS: self.monitors,
            Over.ANNOUNCING: self.announcing,
        }
        return self.links if over is Over.LINKS else tuple(Link(dgu, dgu) for dgu in dgus[over])

    @cached_property
    def present(self) -> tuple[Row[Any], ...]:
        """The rows that the run has."""
        return tuple(row for row in self.rows if row.listed and self.has(row.need))

    @cached_property
    def all(self) -> tuple[Topic, ...]:
        """Every recorded topic in canonical order."""
        found = {}
        for row in self.present:
            for place in self.places(row.over):
                topic = self.topic(row, place)
                found[topic.name] = topic
        return tuple(found.values())

    @cached_property
    def per_step(self) -> tuple[Topic, ...]:
        """The topics with exactly one message at every step, in canonical order."""
        return tuple(topic for topic in self.all if topic.kind is TopicKind.PER_STEP)

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

    @cached_property
    def _topics(self) -> dict[tuple[str, Link], Topic]:
        return {}

    def topic(self, row: Row[Any], place: Link) -> Topic:
        """The topic of a row at a place."""
        if (row.key, place) not in self._topics:
            name = at(row.name, place)
            shared = [other for other in self.places(row.over) if at(row.name, other) == name] or [place]
            self._topics[row.key, place] = Topic(
                name=name,
                type_name=row.type_name,
                publishers=tuple(dict.fromkeys(at(row.publisher, other) for other in shared)),
                kind=row.kind,
                layout=self._layout(row, place),
                definitions=self.definitions,
            )
        return self._topics[row.key, place]

    def _layout(self, row: Row[Any], place: Link) -> Layout | None:
        sequences = tuple((name, int(getattr(self.widths, width))) for name, width in row.sequences.items())
        try:
            return layout_of(row.type_name, at(row.frame, place), sequences, self.definitions)
        except BagError:
            return None  # its messages vary in length

    def codec(self, row: Row[Codec_co], place: Link | int) -> Codec_co:
        """The codec of a row at a link or DGU."""
        place = Link(place, place) if isinstance(place, int) else place
        numbers = {"i": place.source, "j": place.target}
        return row.codec(
            Spot(
                topic=self.topic(row, place),
                period_ns=self.sampling_period_ns,
                place=place,
                frame=at(row.frame, place),
                numbers=tuple(numbers[one] for one in row.numbers.values()),
                sources=self.sources(place.target),
                form=row.form,
            )
        )

    def clock(self) -> ClockCodec:
        """Simulated time on /clock."""
        return self.codec(table.CLOCK, 0)

    def tick(self) -> StepCodec:
        """Step release on /tick."""
        return self.codec(table.TICK, 0)

    def state(self, dgu: int) -> StepCodec:
        """Ground truth of a DGU."""
        return self.codec(table.STATE, dgu)

    def output(self, dgu: int) -> StepCodec:
        """Output of a DGU as sent."""
        return self.codec(table.OUTPUT, dgu)

    def own(self, dgu: int) -> StepCodec:
        """What a DGU itself measures and decides."""
        return self.codec(table.OWN, dgu)

    def received(self, link: Link) -> StepCodec:
        """Output of a DGU as received over a link."""
        return self.codec(table.RECEIVED, link)

    def second(self, link: Link) -> StepCodec:
        """What another publisher sent on the topic of `received(link)`, kept beside it in a bag.

        On the wire these messages are on `/dgu_j/received/dgu_i` like all others; a bag does not tell publishers
        apart, so it has a topic for them, announced with the first one.
        """
        return self.codec(table.SECOND, link)

    def residual(self, of: Link | int) -> StepCodec:
        """What the monitor on a link's target concludes; of a DGU: what it concludes from the own state."""
        return self.codec(table.RESIDUAL if isinstance(of, Link) else table.OWN_RESIDUAL, of)

    def input(self, link: Link) -> StepCodec:
        """What must have acted on the source of a link."""
        return self.codec(table.INPUT, link)

    def verdict(self, monitor: int) -> StepCodec:
        """Which links into a DGU lie."""
        return self.codec(table.VERDICT, monitor)

    def announced(self, dgu: int) -> StepCodec:
        """Inputs of a DGU, for the members of a team that do not hear it."""
        return self.codec(table.ANNOUNCED, dgu)

    def estimate(self, member: int) -> StepCodec:
        """What a member of a team tells."""
        return self.codec(table.ESTIMATE, member)

    def alarms(self, monitor: int) -> AlarmCodec:
        """Starting and ending alarms of a monitor."""
        return self.codec(table.ALARMS, monitor)

    def accusations(self, member: int) -> AlarmCodec:
        """Whom a member of a team accuses: the source of these alarms is another member."""
        return self.codec(table.ACCUSATIONS, member)

    def stream(self, monitor: int) -> StreamCodec:
        """Appearing and ending faults of the streams into a DGU."""
        return self.codec(table.STREAM, monitor)

    def commands(self) -> CommandEventCodec:
        """Commands that took effect; in a bag, a topic that is announced with the first one."""
        return self.codec(table.COMMANDS, 0)

    def attack_commands(self) -> CommandEventCodec:
        """Commands on attacks; announced with the first one, too."""
        return self.codec(table.ATTACK_COMMANDS, 0)

    def command_codec(self, command: Command) -> CommandEventCodec:
        """Of the topic on which a command is told."""
        return self.attack_commands() if isinstance(command, AttackCommand) else self.commands()

    def attack_events(self) -> AttackEventCodec:
        """Starting and ending attacks."""
        return self.codec(table.ATTACKS, 0)

    def diagnostics(self, monitor: int) -> DiagnosticsCodec:
        """Health of a monitor's links, once per simulated second."""
        return self.codec(table.DIAGNOSTICS, monitor)

    def history(self, dgu: int) -> HistoryCodec:
        """Offline experiments of a DGU."""
        return self.codec(table.HISTORY, dgu)

    def grid_history(self) -> HistoryCodec:
        """The experiment on the whole grid; the DGU with the smallest number publishes it."""
        return self.codec(table.GRID_HISTORY, self.places(Over.RUN)[0])

    def design(self, of: Link | int) -> DesignCodec:
        """Observer designed for a link, or for the own state of a DGU."""
        return self.codec(table.DESIGN if isinstance(of, Link) else table.OWN_DESIGN, of)

    def input_design(self, link: Link) -> DesignCodec:
        """Input estimator of a link."""
        return self.codec(table.INPUT_DESIGN, link)

    def team_design(self, member: int) -> DesignCodec:
        """The design of a team as a member found it."""
        return self.codec(table.TEAM_DESIGN, member)


def run_topics(
    dgus: Sequence[int],
    links: Sequence[Link],
    sampling_period_ns: int,
    *,
    team: bool = False,
    parts: Parts | None = None,
    widths: Widths = DGU_WIDTHS,
    definitions: Definitions = (),
) -> RunTopics:
    """The topics of a run; DGUs and links are put into canonical order."""
    return RunTopics(
        dgus=tuple(sorted(dgus)),
        links=tuple(sorted(links, key=lambda link: (link.target, link.source))),
        sampling_period_ns=sampling_period_ns,
        has_team=team,
        parts=parts,
        widths=widths._replace(members=len(dgus)),
        definitions=definitions,
    )


def topics_of(scenario: "Scenario") -> RunTopics:
    """The topics of a scenario's run."""
    settings = settings_of(scenario)
    return run_topics(
        scenario.grid.dgus,
        scenario.links,
        scenario.sampling_period_ns,
        team=settings.team is not None,
        parts=parts_of(settings),
    )


def parts_of(settings: "MonitorSettings") -> Parts | None:
    """What monitors tell besides their residuals; None: nothing."""
    parts = Parts(local=settings.local is not None, inputs=settings.plausibility is not None)
    return parts if settings.combined else None
