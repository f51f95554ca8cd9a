"""All that the monitor of one DGU runs, as one object: the node, the offline run and the replay step the same."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan
from typing import TYPE_CHECKING, NamedTuple

from monitor.combined.isolation import Evidence, Isolation, explains, isolate
from monitor.linear import select

if TYPE_CHECKING:
    from collections.abc import Sequence

    from monitor.combined.plausibility import InputOutput, InputState, PlausibilityTest
    from monitor.combined.response import Response
    from monitor.judging import Judging
    from monitor.linear import Component, Flag, Vector
    from monitor.link_monitor import LinkMonitor, MonitorOutput, MonitorState
    from monitor.local import LocalModule, LocalOutput, LocalState

_REFERENCE = 1  # component of an unknown input


class Received(NamedTuple):
    """One sample from one neighbour: y in V, A, V s, whether the link delivered it, and the known inputs with it."""

    y: Sequence[Component]
    delivered: Flag
    u: Sequence[Component] = ()


class Own(NamedTuple):
    """What the DGU itself measures and decides: y in V, A, V s, and V_ref + alpha [V]."""

    y: Sequence[Component]
    reference: Component


class DguState(NamedTuple):
    """State of everything."""

    links: tuple[MonitorState, ...]
    inputs: tuple[InputState, ...]
    local: LocalState | None
    response: Vector
    voltages: tuple[Component, ...]  # own bus voltage at this step and before, newest first [V]
    responds: bool = True  # unless switched off by hand


class DguVerdict(NamedTuple):
    """What follows from everything at one step.

    Attributes:
        isolation: which links lie.
        dropped: links that secondary control leaves out from this sample on.
    """

    isolation: Isolation
    dropped: tuple[Flag, ...]


class DguOutput(NamedTuple):
    """What everything says at one step; empty or None where a part is not there."""

    links: tuple[MonitorOutput, ...]
    inputs: tuple[InputOutput, ...]
    local: LocalOutput | None
    verdict: DguVerdict


@dataclass(frozen=True, slots=True, kw_only=True)
class DguMonitor:
    """UIO and plausibility test of every incoming link, local module, isolation, response.

    Attributes:
        links: one monitor for each incoming link, by ascending source.
        inputs: one plausibility test for each, or none at all.
        local: the module of the own state, if it is there.
        response: how long an accused link is left out; None: never.
    """

    links: tuple[LinkMonitor, ...]
    inputs: tuple[PlausibilityTest, ...] = ()
    local: LocalModule | None = None
    response: Response | None = None

    def init(self) -> DguState:
        """State before the first sample."""
        return DguState(
            links=tuple([one.init() for one in self.links]),
            inputs=tuple([one.init() for one in self.inputs]),
            local=None if self.local is None else self.local.init(),
            response=() if self.response is None else self.response.init(len(self.links)),
            voltages=(nan,) * (1 + max([one.lag for one in self.inputs], default=0)),
        )

    def step(
        self, state: DguState, received: Sequence[Received], own: Own | None = None, stream: Sequence[Flag] = ()
    ) -> tuple[DguState, DguOutput]:
        """Take the samples of one step.

        Args:
            state: where everything is.
            received: one sample from each neighbour, by ascending source.
            own: the own sample; needed by the local module alone.
            stream: what the guards of the streams say about each link; none: nothing.
        """
        links = [
            one.step(was, sample.y, sample.delivered, sample.u)
            for one, was, sample in zip(self.links, state.links, received, strict=True)
        ]
        voltages = state.voltages if own is None else (own.y[0], *state.voltages[:-1])
        inputs = [
            one.step(was, sample.y, sample.delivered, self._explained(link, voltages[one.lag]))
            for link, (one, was, sample) in enumerate(zip(self.inputs, state.inputs, received, strict=False))
        ]
        local_state, local = self._local(state.local, received, own)
        says = [output for _, output in inputs]
        quiet: list[Flag] = [False] * len(self.links)
        isolation = isolate(
            Evidence(
                residual=[output.alarm for _, output in links],
                plausibility=[output.alarm for output in says] or quiet,
                stream=stream or quiet,
                local=False if local is None else local.monitor.alarm,
                explains=quiet if local is None or self.local is None else self._explains(self.local, local, says),
            )
        )
        response, dropped = state.response, (*quiet,)
        if self.response is not None:
            response, left_out = self.response.step(state.response, isolation.accused)
            dropped = left_out if state.responds else dropped
        following = state._replace(
            links=tuple([one for one, _ in links]),
            inputs=tuple([one for one, _ in inputs]),
            local=local_state,
            response=response,
            voltages=voltages,
        )
        verdict = DguVerdict(isolation, dropped)
        return following, DguOutput(tuple([output for _, output in links]), tuple(says), local, verdict)

    def overruled(self, state: DguState, link: int, judging: Judging) -> DguState:
        """State after something was said by hand about the detector of a link, by its place among `links`."""
        return _with_link(state, link, state.links[link]._replace(judging=judging))

    def recalibrated(self, state: DguState, link: int) -> DguState:
        """State in which the detector of a link begins again."""
        return _with_link(state, link, self.links[link].recalibrated(state.links[link]))

    def _local(
        self, state: LocalState | None, received: Sequence[Received], own: Own | None
    ) -> tuple[LocalState | None, LocalOutput | None]:
        if self.local is None or state is None or own is None:
            return state, None
        voltages = [_voltage(sample) for sample in received]
        return self.local.step(state, own.y, own.reference, voltages)

    def _explained(self, link: int, voltage: Component) -> Component:
        """The current that the own bus sends into a neighbour, as its input I_net + I_L feels it: -V_j / R_ij [A]."""
        if self.local is None or not len(self.local.design.conductances):
            return 0.0
        return float(-self.local.design.conductances[link]) * voltage

    def _explains(self, module: LocalModule, local: LocalOutput, inputs: Sequence[InputOutput]) -> list[Flag]:
        conductances = module.design.conductances.tolist() or [0.0] * len(self.links)
        limits = [(one.input[_REFERENCE], one.lower[_REFERENCE], one.upper[_REFERENCE]) for one in inputs] or [
            (nan, nan, nan)
        ] * len(self.links)
        return [
            explains(local.excess, conductance, *known) for conductance, known in zip(conductances, limits, strict=True)
        ]


def _with_link(state: DguState, link: int, one: MonitorState) -> DguState:
    return state._replace(links=(*state.links[:link], one, *state.links[link + 1 :]))


def _voltage(sample: Received) -> Component:
    """The bus voltage that a neighbour says it has [V]; NaN where the link did not deliver it."""
    return select(sample.delivered, sample.y[0], nan)
