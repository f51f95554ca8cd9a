"""The monitors of all DGUs of a run while it goes on: what simulation, replay and study step.

Monitors that look at each link by itself step all links at once, in blocks. Those that draw one conclusion from several
tests step through the same `DguMonitor.step` as in a node, one run in floats, several side by side in arrays. Both are
fed with the same numbers as a node and have the same bits.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from bags.watch.combined_arrays import CombinedFields, fields_of
from bags.watch.designs import RunDesigns
from bags.watch.monitors import MonitorArrays, RunMonitors, joined, monitors_of
from bags.watch.steering import Given, LaneSteering, steer_monitor
from bags.wire.row import Widths
from dgu_sim.commands import Command
from dgu_sim.script import CommandEvent
from monitor.combined import DguMonitor, DguOutput, DguState, Own, Received
from monitor.linear import Component, Flag
from monitor.link_monitor import MonitorOutput, MonitorState


class Conclusions(NamedTuple):
    """What all monitors concluded over some steps of one run.

    Attributes:
        links: What the monitors of the links concluded.
        combined: Everything else, as message fields; None: there is nothing else.
    """

    links: MonitorArrays
    combined: CombinedFields | None


class Seen(Protocol):
    """Consecutive steps of one run, as far as its monitors are told; a `RunRecord` is one."""

    @property
    def y(self) -> NDArray[np.float64]:
        """Outputs as sent, shape (steps, DGUs, p)."""

    @property
    def reference(self) -> NDArray[np.float64]:
        """V_ref + alpha, shape (steps, DGUs) [V]."""

    @property
    def received(self) -> NDArray[np.float64]:
        """y^c, shape (steps, links, p)."""

    @property
    def u(self) -> NDArray[np.float64] | None:
        """Known inputs that travelled with them, shape (steps, links, m); None: none did."""

    @property
    def delivered(self) -> NDArray[np.bool_]:
        """Shape (steps, links)."""


@dataclass(slots=True, kw_only=True)
class Watcher:
    """All monitors of a run while it goes on: a `dgu_sim.simulate.Respond` that remembers what they said.

    Attributes:
        designs: What runs at each monitor.
        runs: Runs side by side.
    """

    designs: RunDesigns
    runs: int = 1
    _monitors: tuple[DguMonitor, ...] = field(init=False)
    _states: list[DguState] = field(init=False)
    _incoming: list[list[int]] = field(init=False)
    _own: list[int] = field(init=False)
    _rows: list[list[DguOutput]] = field(init=False)
    _lanes: RunMonitors | None = None
    _lane_states: tuple[MonitorState, ...] = ()
    _steering: LaneSteering = field(init=False)

    def __post_init__(self) -> None:
        """Start all monitors."""
        topics, self._monitors = self.designs.topics, self.designs.monitors
        self._states = [one.init() for one in self._monitors]
        links, monitors = topics.links, topics.monitors
        self._incoming = [[at for at, link in enumerate(links) if link.target == one] for one in monitors]
        self._own = [topics.dgus.index(one) for one in monitors]
        self._rows = []
        self._steering = LaneSteering(links)
        if topics.combined is None:
            self._lanes = monitors_of(self.designs)
            self._lane_states = self._lanes.init()

    def fork(self) -> "Watcher":
        """The same monitors, as they are now, for another future: states never change, so they are shared."""
        other = Watcher(designs=self.designs, runs=self.runs)
        other._states, other._rows, other._lane_states = list(self._states), list(self._rows), self._lane_states
        return other

    def __call__(
        self,
        sent: NDArray[np.float64],
        reference: NDArray[np.float64],
        received: NDArray[np.float64],
        delivered: NDArray[np.bool_],
        spoofed: Sequence[int] = (),
        *,
        commands: Sequence[CommandEvent] = (),
    ) -> NDArray[np.bool_]:
        """Step all monitors; see `dgu_sim.simulate.Respond`."""
        self.steer([one.command for one in commands])
        outputs = self.step(sent, reference, received, delivered, [at in spoofed for at in range(delivered.shape[1])])
        dropped = np.zeros(delivered.shape, dtype=np.bool_)
        for incoming, output in zip(self._incoming, outputs, strict=True):
            for at, flag in zip(incoming, output.verdict.dropped, strict=True):
                dropped[:, at] = flag
        if self.runs == 1:
            self._rows.append(outputs)
        return dropped

    def steer(self, commands: Sequence[Command]) -> None:
        """Let commands act on the monitors from the next step on."""
        topics = self.designs.topics
        for command in commands:
            if self._lanes is not None:
                self._lane_states = self._steering.take(command, self._lanes, self._lane_states)
                continue
            for number, (monitor, dgu) in enumerate(zip(self._monitors, topics.monitors, strict=True)):
                state = self._states[number]
                self._states[number] = steer_monitor(monitor, state, dgu, topics.sources(dgu), command)

    def step(
        self,
        sent: NDArray[np.float64],
        reference: NDArray[np.float64],
        received: NDArray[np.float64],
        delivered: NDArray[np.bool_],
        lying: Sequence[Flag],
        *,
        u: NDArray[np.float64] | None = None,
    ) -> list[DguOutput]:
        """What each monitor says to one step.

        Args:
            sent: As in `__call__`, and so are `reference`, `received` and `delivered`.
            reference: See there.
            received: See there.
            delivered: See there.
            lying: What the guards say about the stream of each link.
            u: Known inputs that travelled with `received`, shape (m, runs, links); None: none did.
        """
        alone = self.runs == 1
        y, own_y = _vectors(received, alone=alone), _vectors(sent, alone=alone)
        references: Sequence[Component] = reference[0].tolist() if alone else list(reference.T)
        arrived: Sequence[Flag] = delivered[0].tolist() if alone else list(delivered.T)
        inputs: Sequence[Sequence[Component]] = [()] * len(y) if u is None else _vectors(u, alone=alone)
        outputs = []
        for number, (monitor, incoming, own) in enumerate(zip(self._monitors, self._incoming, self._own, strict=True)):
            self._states[number], output = monitor.step(
                self._states[number],
                [Received(y[at], arrived[at], inputs[at]) for at in incoming],
                Own(own_y[own], references[own]),
                [lying[at] for at in incoming],
            )
            outputs.append(output)
        return outputs

    def follow(self, seen: Seen, spoofed: Mapping[int, Sequence[int]], given: Given | None = None) -> Conclusions:
        """Take consecutive steps of one run that is over: links alone in blocks, everything together step by step.

        Args:
            seen: What happened.
            spoofed: By row, positions of the links whose stream was not one publisher's in order.
            given: Commands by the row from which on they act; None: there are none.
        """
        given = {} if given is None else given
        if self._lanes is not None:
            return Conclusions(links=self._follow_lanes(self._lanes, seen, given), combined=None)
        for row in range(len(seen.delivered)):
            self.steer(given.get(row, ()))
            y, y_c = seen.y[row].T[:, None], seen.received[row].T[:, None]
            u, arrived = None if seen.u is None else seen.u[row].T[:, None], seen.delivered[row][None]
            lying = [at in spoofed.get(row, ()) for at in range(arrived.shape[1])]
            self._rows.append(self.step(y, seen.reference[row][None], y_c, arrived, lying, u=u))
        return self.take()

    def _follow_lanes(self, lanes: RunMonitors, seen: Seen, given: Given) -> MonitorArrays:
        """Take steps in one go, or in several between commands."""
        parts = []
        for start, end in pairwise([0, *sorted(given.keys() - {0}), len(seen.delivered)]):
            self.steer(given.get(start, ()))
            u = None if seen.u is None else seen.u[start:end]
            self._lane_states, part = lanes.run(
                self._lane_states, seen.received[start:end], seen.delivered[start:end], u
            )
            self._steering.overrule(part)
            parts.append(part)
        return parts[0] if len(parts) == 1 else joined(parts)

    def take(self) -> Conclusions:
        """What was said since the last call, of one run."""
        rows, self._rows = self._rows, []
        combined = self.designs.topics.combined
        assert combined is not None  # noqa: S101 - whoever makes a Watcher has seen to it
        lags = [one.lag for monitor in self._monitors for one in monitor.inputs]
        return Conclusions(
            links=_links(rows, len(self.designs.topics.links), self.designs.topics.widths),
            combined=fields_of(rows, lags, combined),
        )


def _vectors(components: NDArray[np.float64], *, alone: bool) -> list[list[Component]]:
    """Vectors of (3, runs, places) for each place: floats of a single run, arrays over runs of many."""
    if alone:
        vectors: list[list[Component]] = components[:, 0].T.tolist()
        return vectors
    return [list(vector) for vector in components.transpose(2, 0, 1)]


def _links(rows: Sequence[Sequence[DguOutput]], links: int, widths: Widths) -> MonitorArrays:
    """What the monitors of the links concluded."""
    steps = len(rows)
    arrays = MonitorArrays(
        phase=np.zeros((steps, links), dtype=np.uint8),
        alarm=np.zeros((steps, links), dtype=np.bool_),
        estimate=np.full((steps, links, widths.states), np.nan),
        residual=np.full((steps, links, widths.outputs), np.nan),
        threshold=np.full((steps, links, widths.outputs), np.nan),
    )
    for name in MonitorOutput._fields if steps and links else ():
        getattr(arrays, name)[:] = [[getattr(said, name) for one in row for said in one.links] for row in rows]
    return arrays
