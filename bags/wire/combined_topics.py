"""The topics that a run has besides the others when its monitors draw one conclusion from several tests."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import final

from bags.mcap.cdr import Layout, layout_of
from bags.mcap.topic import Topic, TopicKind
from bags.wire.codecs import ResidualCodec, stamp_of
from bags.wire.documents import DesignCodec
from dgu_sim.grid import Link
from monitor.combined import DguVerdict, InputOutput, Isolation, Own
from monitor.linear import Flag

MASKS = ("accused", "by_residual", "by_plausibility", "by_stream", "by_local", "suspected")
"""Fields of Verdict.msg, and of an Isolation, that have one bit for each incoming link."""

_OURS = re.compile(r"/dgu_\d+/(?:(own)|(verdict)|(input)/dgu_\d+)")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """Which topics there are; the verdict always.

    Attributes:
        local: The own samples and the residual of the own state.
        inputs: The reconstructed inputs.
    """

    local: bool
    inputs: bool


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class OwnCodec:
    """`dcmg_msgs/msg/Own`: what a DGU tells the monitor that it hosts."""

    topic: Topic
    layout: Layout
    period_ns: int
    dgu: int

    def encode(self, step: int, own: Own) -> bytes:
        """Bytes of step k."""
        return self.layout.pack(*stamp_of(step, self.period_ns), step, self.dgu, *own.y, own.reference)

    def decode(self, data: bytes) -> tuple[int, Own]:
        """Step and what was told."""
        _, _, step, _, V, I_t, v, reference = self.layout.unpack(data)
        return step, Own((V, I_t, v), reference)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class InputCodec:
    """`dcmg_msgs/msg/InputEstimate`: what must have acted on a neighbour."""

    topic: Topic
    layout: Layout
    period_ns: int
    source: int
    monitor: int

    def encode(self, step: int, lag: int, output: InputOutput) -> bytes:
        """Bytes of step k."""
        return self.layout.pack(
            *stamp_of(step, self.period_ns),
            step,
            self.source,
            self.monitor,
            lag,
            output.phase,
            output.alarm,
            *output.input,
            *output.lower,
            *output.upper,
            *output.rate,
        )

    def decode(self, data: bytes) -> tuple[int, int, InputOutput]:
        """Step, lag and judgement."""
        _, _, step, _, _, lag, phase, alarm, *numbers = self.layout.unpack(data)
        return step, lag, InputOutput(phase, alarm, *(tuple(numbers[at : at + 2]) for at in range(0, 8, 2)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class VerdictCodec:
    """`dcmg_msgs/msg/Verdict`: which incoming links lie; flags travel as masks over the ascending sources."""

    topic: Topic
    layout: Layout
    period_ns: int
    monitor: int
    links: int

    def encode(self, step: int, verdict: DguVerdict) -> bytes:
        """Bytes of step k."""
        isolation = verdict.isolation
        masks = [mask_of(getattr(isolation, name)) for name in MASKS]
        stamp = stamp_of(step, self.period_ns)
        return self.layout.pack(*stamp, step, self.monitor, *masks, isolation.local, mask_of(verdict.dropped))

    def decode(self, data: bytes) -> tuple[int, DguVerdict]:
        """Step and verdict."""
        _, _, step, _, *masks, local, dropped = self.layout.unpack(data)
        flags = {name: self._flags(mask) for name, mask in zip(MASKS, masks, strict=True)}
        return step, DguVerdict(Isolation(**flags, local=bool(local)), self._flags(dropped))

    def _flags(self, mask: int) -> tuple[Flag, ...]:
        return tuple(bool(mask >> bit & 1) for bit in range(self.links))


@final
@dataclass(frozen=True, kw_only=True)
class CombinedTopics:
    """The topics and their codecs.

    Attributes:
        links: Directed communication links, ordered by (target, source).
        monitors: The DGUs that receive something, ascending.
        sampling_period_ns: T_s [ns].
        parts: Which topics there are.
    """

    links: tuple[Link, ...]
    monitors: tuple[int, ...]
    sampling_period_ns: int
    parts: Parts

    @cached_property
    def sent(self) -> tuple[Topic, ...]:
        """Per-step topics that DGUs publish, in canonical order."""
        return tuple(self.own(dgu).topic for dgu in self.monitors) if self.parts.local else ()

    @cached_property
    def concluded(self) -> tuple[Topic, ...]:
        """Per-step topics that monitors publish, in canonical order."""
        inputs = [self.input(link).topic for link in self.links] if self.parts.inputs else []
        residuals = [self.residual(monitor).topic for monitor in self.monitors] if self.parts.local else []
        return (*residuals, *inputs, *(self.verdict(monitor).topic for monitor in self.monitors))

    @property
    def per_step(self) -> tuple[Topic, ...]:
        """All topics with one message at every step."""
        return (*self.sent, *self.concluded)

    @property
    def latched(self) -> tuple[Topic, ...]:
        """Topics that speak before step 0."""
        own = [self.design(monitor).topic for monitor in self.monitors] if self.parts.local else []
        inputs = [self.input_design(link).topic for link in self.links] if self.parts.inputs else []
        return (*own, *inputs)

    def sources(self, monitor: int) -> tuple[int, ...]:
        """The DGUs that a DGU receives from, ascending: the bits of a mask."""
        return tuple(link.source for link in self.links if link.target == monitor)

    def own(self, dgu: int) -> OwnCodec:
        """What a DGU itself measures and decides."""
        topic, layout = _per_step(f"/dgu_{dgu}/own", "dcmg_msgs/msg/Own", f"dgu_{dgu}", dgu)
        return OwnCodec(topic=topic, layout=layout, period_ns=self.sampling_period_ns, dgu=dgu)

    def residual(self, monitor: int) -> ResidualCodec:
        """What the local module concludes."""
        name = f"/dgu_{monitor}/residual/dgu_{monitor}"
        topic, layout = _per_step(name, "dcmg_msgs/msg/Residual", f"monitor_{monitor}", monitor)
        return ResidualCodec(
            topic=topic, layout=layout, period_ns=self.sampling_period_ns, source=monitor, monitor=monitor
        )

    def input(self, link: Link) -> InputCodec:
        """What must have acted on the source of a link."""
        name = f"/dgu_{link.target}/input/dgu_{link.source}"
        topic, layout = _per_step(name, "dcmg_msgs/msg/InputEstimate", f"monitor_{link.target}", link.target)
        return InputCodec(
            topic=topic, layout=layout, period_ns=self.sampling_period_ns, source=link.source, monitor=link.target
        )

    def verdict(self, monitor: int) -> VerdictCodec:
        """Which links into a DGU lie."""
        topic, layout = _per_step(f"/dgu_{monitor}/verdict", "dcmg_msgs/msg/Verdict", f"monitor_{monitor}", monitor)
        return VerdictCodec(
            topic=topic,
            layout=layout,
            period_ns=self.sampling_period_ns,
            monitor=monitor,
            links=len(self.sources(monitor)),
        )

    def design(self, monitor: int) -> DesignCodec:
        """Observer of the own state."""
        topic = _latched(f"/dgu_{monitor}/design/dgu_{monitor}", monitor)
        return DesignCodec(topic=topic, source=monitor, monitor=monitor)

    def input_design(self, link: Link) -> DesignCodec:
        """Input estimator of a link."""
        topic = _latched(f"/dgu_{link.target}/input_design/dgu_{link.source}", link.target)
        return DesignCodec(topic=topic, source=link.source, monitor=link.target)


def parts_among(names: Iterable[str]) -> Parts | None:
    """Which of the topics a bag holds; None: none of them."""
    found = {kind for name in names if (match := _OURS.fullmatch(name)) for kind in match.groups() if kind}
    return Parts(local="own" in found, inputs="input" in found) if "verdict" in found else None


def mask_of(flags: Sequence[Flag]) -> int:
    """Bit i is flag i."""
    return sum(1 << bit for bit, flag in enumerate(flags) if flag)


def _per_step(name: str, type_name: str, node: str, dgu: int) -> tuple[Topic, Layout]:
    layout = layout_of(type_name, f"dgu_{dgu}")
    return Topic(name=name, type_name=type_name, publishers=(node,), kind=TopicKind.PER_STEP, layout=layout), layout


def _latched(name: str, monitor: int) -> Topic:
    node = f"monitor_{monitor}"
    return Topic(name=name, type_name="dcmg_msgs/msg/Design", publishers=(node,), kind=TopicKind.LATCHED)
