"""The topics that a run has besides the others when its monitors work as a team."""

from dataclasses import dataclass
from functools import cached_property
from math import nan
from typing import final

from bags.mcap.cdr import Layout, layout_of
from bags.mcap.topic import Topic, TopicKind
from bags.wire.codecs import AlarmCodec, stamp_of
from bags.wire.documents import DesignCodec, HistoryCodec
from dgu_sim.grid import Link
from monitor.team import MemberOutput

GRID = 0
"""Number of the whole grid where DGUs are numbered from 1."""

_WIDTH = 3  # V, I_t, v of a DGU


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class InputsCodec:
    """`dcmg_msgs/msg/Inputs`: what acts on one DGU."""

    topic: Topic
    layout: Layout
    period_ns: int
    dgu: int

    def encode(self, step: int, inputs: tuple[float, float]) -> bytes:
        """Bytes of step k: I_L [A] and V_ref + alpha [V], NaN where one is not announced."""
        return self.layout.pack(*stamp_of(step, self.period_ns), step, self.dgu, *inputs)

    def decode(self, data: bytes) -> tuple[int, tuple[float, float]]:
        """Step and inputs."""
        _, _, step, _, load_current, reference = self.layout.unpack(data)
        return step, (load_current, reference)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TeamEstimateCodec:
    """`dcmg_msgs/msg/TeamEstimate`: what one member tells the others."""

    topic: Topic
    layout: Layout
    period_ns: int
    monitor: int
    team: int

    def encode(self, step: int, output: MemberOutput) -> bytes:
        """Bytes of step k."""
        return self.layout.pack(
            *stamp_of(step, self.period_ns),
            step,
            self.monitor,
            output.phase,
            *output.alarm,
            *output.estimate,
            *output.disagreement,
            *output.threshold,
        )

    def decode(self, data: bytes) -> tuple[int, MemberOutput]:
        """Step and what was told."""
        _, _, step, _, phase, *values = self.layout.unpack(data)
        alarm, numbers, width = values[: self.team], values[self.team :], _WIDTH * self.team
        vectors = (tuple(numbers[at : at + width]) for at in range(0, 3 * width, width))
        return step, MemberOutput(phase, tuple(alarm), *vectors)


@final
@dataclass(frozen=True, kw_only=True)
class TeamTopics:
    """The topics of a team and their codecs.

    Attributes:
        dgus: DGU numbers, ascending; each hosts a member.
        links: Directed communication links.
        sampling_period_ns: T_s [ns].
    """

    dgus: tuple[int, ...]
    links: tuple[Link, ...]
    sampling_period_ns: int

    @cached_property
    def announcing(self) -> tuple[int, ...]:
        """DGUs whose output some member does not hear, ascending: they announce their inputs."""
        return tuple(dgu for dgu in self.dgus if self.unaware(dgu))

    @cached_property
    def per_step(self) -> tuple[Topic, ...]:
        """Topics with one message at every step, in canonical order."""
        return (
            *(self.inputs(dgu).topic for dgu in self.announcing),
            *(self.estimate(dgu).topic for dgu in self.dgus),
        )

    @property
    def events(self) -> tuple[Topic, ...]:
        """Topics that speak on occasion."""
        return tuple(self.alarms(dgu).topic for dgu in self.dgus)

    @property
    def latched(self) -> tuple[Topic, ...]:
        """Topics that speak before step 0."""
        return (self.history().topic, *(self.design(dgu).topic for dgu in self.dgus))

    def hears(self, member: int) -> tuple[int, ...]:
        """DGUs whose output a member measures, ascending, itself included."""
        return tuple(sorted({member, *(link.source for link in self.links if link.target == member)}))

    def unaware(self, dgu: int) -> tuple[int, ...]:
        """Members that do not hear a DGU, ascending."""
        return tuple(member for member in self.dgus if dgu not in self.hears(member))

    def inputs(self, dgu: int) -> InputsCodec:
        """Inputs of a DGU, for the members that do not hear it."""
        name = f"dgu_{dgu}"
        layout = layout_of("dcmg_msgs/msg/Inputs", name)
        topic = Topic(
            name=f"/{name}/inputs",
            type_name=layout.type_name,
            publishers=(name,),
            kind=TopicKind.PER_STEP,
            layout=layout,
        )
        return InputsCodec(topic=topic, layout=layout, period_ns=self.sampling_period_ns, dgu=dgu)

    def estimate(self, member: int) -> TeamEstimateCodec:
        """What a member tells."""
        team = len(self.dgus)
        sequences = (("alarm", team), *((name, _WIDTH * team) for name in ("estimate", "disagreement", "threshold")))
        layout = layout_of("dcmg_msgs/msg/TeamEstimate", f"dgu_{member}", sequences)
        topic = Topic(
            name=f"/dgu_{member}/estimate",
            type_name=layout.type_name,
            publishers=(f"monitor_{member}",),
            kind=TopicKind.PER_STEP,
            layout=layout,
        )
        return TeamEstimateCodec(
            topic=topic, layout=layout, period_ns=self.sampling_period_ns, monitor=member, team=team
        )

    def alarms(self, member: int) -> AlarmCodec:
        """Whom a member accuses: the source of these alarms is another member."""
        layout = layout_of("dcmg_msgs/msg/Alarm", f"dgu_{member}")
        topic = Topic(
            name=f"/dgu_{member}/team_alarms",
            type_name=layout.type_name,
            publishers=(f"monitor_{member}",),
            kind=TopicKind.EVENT,
            layout=layout,
        )
        return AlarmCodec(topic=topic, layout=layout, period_ns=self.sampling_period_ns, monitor=member)

    def design(self, member: int) -> DesignCodec:
        """The design of the team as a member found it."""
        topic = _latched(f"/dgu_{member}/design/grid", "dcmg_msgs/msg/Design", f"monitor_{member}")
        return DesignCodec(topic=topic, source=GRID, monitor=member)

    def history(self) -> HistoryCodec:
        """The experiment on the whole grid; the DGU with the smallest number publishes it."""
        return HistoryCodec(topic=_latched("/grid/history", "dcmg_msgs/msg/History", f"dgu_{self.dgus[0]}"), dgu=GRID)


def announced(inputs: tuple[float, float], told: tuple[bool, bool]) -> tuple[float, float]:
    """Inputs with NaN for those that are not announced."""
    load, reference = (value if said else nan for value, said in zip(inputs, told, strict=True))
    return load, reference


def _latched(name: str, type_name: str, node: str) -> Topic:
    return Topic(name=name, type_name=type_name, publishers=(node,), kind=TopicKind.LATCHED)
