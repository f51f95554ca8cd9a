"""All monitors of a run at once, as the offline simulation and the replay need them.

A node steps one LinkMonitor with floats. Here the same LinkMonitor steps all links whose observers have the same
shape with arrays over links: the same multiply-adds in the same order, so the same bits.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import partial
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bags.watch.compiled_monitors import judges_itself, knows, run_compiled
from bags.watch.designs import RunDesigns, design_scenario
from bags.watch.monitor_blocks import run_monitor
from bags.watch.stacked_observer import StackedObserver
from dgu_sim.grid import Link
from dgu_sim.scenario import Scenario
from monitor.delayed import ConstantInput
from monitor.detectors import Detector, Phase
from monitor.link_design import LinkDesign
from monitor.link_monitor import LinkMonitor, MonitorOutput, MonitorState
from monitor.measures import changed
from monitor.observers import LinearObserver, Observer
from monitor.options import within


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkGroup:
    """Links whose monitors step together.

    Attributes:
        positions: Where they are on the axis "links", shape (group,).
        monitor: Their monitors as one.
    """

    positions: NDArray[np.intp]
    monitor: LinkMonitor


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitorArrays:
    """What all monitors concluded over some steps; the fields are those of RunRecord."""

    phase: NDArray[np.uint8]
    alarm: NDArray[np.bool_]
    estimate: NDArray[np.float64]
    residual: NDArray[np.float64]
    threshold: NDArray[np.float64]

    def lanes(self, shape: tuple[int, ...]) -> "MonitorArrays":
        """The same with other axes in place of "links"."""
        each = {one.name: getattr(self, one.name) for one in fields(self)}
        return MonitorArrays(**{name: one.reshape(len(one), *shape, *one.shape[2:]) for name, one in each.items()})

    def at(self, row: int, link: int) -> MonitorOutput:
        """What one monitor concluded at one step, as numbers."""
        return MonitorOutput(
            phase=int(self.phase[row, link]),
            alarm=bool(self.alarm[row, link]),
            estimate=self.estimate[row, link].tolist(),
            residual=self.residual[row, link].tolist(),
            threshold=self.threshold[row, link].tolist(),
        )


def joined(parts: Sequence[MonitorArrays]) -> MonitorArrays:
    """Consecutive steps in one."""
    names = [one.name for one in fields(MonitorArrays)]
    return MonitorArrays(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


@dataclass(frozen=True, slots=True, kw_only=True)
class RunMonitors:
    """The monitors of all links of a run.

    Attributes:
        designs: What was designed for each link, in the order of the links.
        groups: How they step.
        states: n, components of an estimate; None: as many as a sample has.
    """

    designs: tuple[LinkDesign, ...]
    groups: tuple[LinkGroup, ...]
    states: int | None = None

    def init(self) -> tuple[MonitorState, ...]:
        """State before the first sample."""
        return tuple(group.monitor.init() for group in self.groups)

    def run(
        self,
        states: Sequence[MonitorState],
        received: NDArray[np.float64],
        delivered: NDArray[np.bool_],
        u: NDArray[np.float64] | None = None,
    ) -> tuple[tuple[MonitorState, ...], MonitorArrays]:
        """Take the samples of consecutive steps.

        Args:
            states: State of each group.
            received: Shape (steps, links, p), or with more axes in place of "links": runs, attacks; so are conclusions.
            delivered: Shape (steps, links).
            u: Known inputs that travel with the outputs, shape (steps, links, m); None: none do.
        """
        lanes, outputs = delivered.shape[1:], received.shape[-1]
        shape = (len(delivered), prod(lanes))
        delivered = delivered.reshape(shape)
        received = received.reshape(*shape, outputs)
        inputs = np.empty((*shape, 0)) if u is None else u.reshape(*shape, u.shape[-1])
        known = outputs if self.states is None else self.states
        blank = np.empty if self._fill(shape[1], outputs, known) else partial(np.full, fill_value=np.nan)
        arrays = MonitorArrays(
            phase=np.full(shape, Phase.REFUSED.value, dtype=np.uint8),
            alarm=np.zeros(shape, dtype=np.bool_),
            estimate=blank((*shape, known)),
            residual=blank((*shape, outputs)),
            threshold=blank((*shape, outputs)),
        )
        following = [
            _run_group(group, state, (inputs, received), delivered, arrays)
            for group, state in zip(self.groups, states, strict=True)
        ]
        return tuple(following), arrays.lanes(lanes)

    def verdicts(
        self, states: Sequence[MonitorState], received: NDArray[np.float64], delivered: NDArray[np.bool_]
    ) -> tuple[tuple[MonitorState, ...], NDArray[np.uint8], NDArray[np.bool_]]:
        """Do as `run` for whoever wants phases and alarms alone, both of the shape of `delivered`."""
        if not all(knows(one.monitor, 0) and judges_itself(one.monitor) for one in self.groups):
            following, arrays = self.run(states, received, delivered)
            return following, arrays.phase, arrays.alarm
        shape = (len(delivered), prod(delivered.shape[1:]))
        y, arrived = received.reshape(*shape, received.shape[-1]), delivered.reshape(shape)
        phase = np.full(shape, Phase.REFUSED.value, dtype=np.uint8)
        alarm = np.zeros(shape, dtype=np.bool_)
        samples = (np.empty((*shape, 0)), y, arrived)
        following = tuple(
            run_compiled(one.monitor, state, one.positions, samples, (None, None, None, phase, alarm))
            for one, state in zip(self.groups, states, strict=True)
        )
        return following, phase.reshape(delivered.shape), alarm.reshape(delivered.shape)

    def _fill(self, links: int, outputs: int, known: int) -> bool:
        """Whether every number of every link is written, so that none has to be blank before."""
        whole = [
            len(group.positions)
            for group in self.groups
            if isinstance(group.monitor.observer, StackedObserver)
            and not group.monitor.blind
            and group.monitor.observer.outputs == outputs
            and group.monitor.observer.states >= known
        ]
        return sum(whole) == links


def monitors_of(designs: RunDesigns, runs: int = 1) -> RunMonitors:
    """The monitors of all links of a run, or of several side by side, run after run on the axis "links".

    Raises:
        monitor.errors.MonitorError: Unknown kind or option of the detector.
    """
    links = designs.links * runs
    states = designs.topics.widths.states
    detector = designs.detector
    with within("detector"):
        return RunMonitors(designs=links, groups=group_monitors(links, detector), states=states)


def link_monitors(scenario: Scenario, runs: int = 1) -> RunMonitors:
    """What watches each link of a scenario by itself, whatever else its monitors run; for several runs side by side.

    Raises:
        BagError: A recorded history cannot be read.
        monitor.errors.MonitorError: Unknown kind or option.
    """
    told = {name: part for name, part in scenario.monitor.items() if name in {"observer", "detector"}}
    return monitors_of(design_scenario(scenario.model_copy(update={"monitor": told})), runs)


def group_monitors(designs: Sequence[LinkDesign], detector: Detector[Any]) -> tuple[LinkGroup, ...]:
    """Put the monitors of all links together, those of equal shape into one.

    Args:
        designs: What watches each link.
        detector: The detector of every link.
    """
    return tuple(
        LinkGroup(
            positions=np.array(positions, dtype=np.intp),
            monitor=LinkMonitor(
                observer=observer,
                detector=detector,
                channels=designs[positions[0]].channels,
                blind=designs[positions[0]].blind,
            ),
        )
        for positions, observer in _grouped(designs)
    )


def alarm_changes(alarm: NDArray[np.bool_], before: NDArray[np.bool_], links: Sequence[Link]) -> list[tuple[int, int]]:
    """Row and link position of every alarm that starts or ends, in the order in which they are told.

    Args:
        alarm: Verdicts, shape (steps, links).
        before: Verdicts at the step before the first, shape (links,).
        links: The links.
    """
    rows, positions = np.nonzero(changed(alarm, before))
    found = zip(rows.tolist(), positions.tolist(), strict=True)
    return sorted(found, key=lambda one: (one[0], links[one[1]].target, links[one[1]].source))


def _grouped(designs: Sequence[LinkDesign]) -> list[tuple[list[int], Observer]]:
    """Positions and observer of the links that step together; refused ones are in no group."""
    shapes: dict[tuple[object, ...], list[int]] = {}
    for position, design in enumerate(designs):
        observer = design.observer
        linear = _linear(observer)
        if linear is not None:
            shape = (linear is observer, linear.order, linear.states, linear.outputs, linear.inputs, linear.lag)
            shapes.setdefault((design.blind, design.channels, *shape), []).append(position)
        elif observer is not None:
            shapes[position,] = [position]
    return [
        (positions, _stacked([designs[position].observer for position in positions])) for positions in shapes.values()
    ]


def _stacked(members: Sequence[Observer | None]) -> Observer:
    linear = [one for one in map(_linear, members) if one is not None]
    if not linear:
        (only,) = members
        assert only is not None  # noqa: S101 - the caller leaves refused designs out
        return only
    first, period = linear[0], _period([id(one) for one in linear])
    own = linear[:period]
    whole = np.stack([np.block([[one.H, one.J], [one.M, one.D], [one.A, one.B]]) for one in own], axis=-1)
    repeats = (1, 1, len(linear) // period)
    stacked = StackedObserver(
        whole=np.tile(whole, repeats),
        start=np.tile(np.stack([one.Z for one in own], axis=-1), repeats),
        inputs=first.inputs,
        outputs=first.outputs,
        states=first.states,
        lag=first.lag,
        period=period,
    )
    return stacked if first is members[0] else ConstantInput(stacked)


def _period(values: Sequence[int]) -> int:
    """After how many the values repeat to the end; all of them when they do not."""
    size = len(values)
    again = (at for at in range(1, size // 2 + 1) if values[at] == values[0] and size % at == 0)
    return next((at for at in again if values[at:] == values[:-at]), size)


def _linear(observer: Observer | None) -> LinearObserver | None:
    """The matrices that step: of the observer itself, or of the one behind a constant input."""
    inner = observer.inner if isinstance(observer, ConstantInput) else observer
    return inner if isinstance(inner, LinearObserver) else None


def _run_group(
    group: LinkGroup,
    state: MonitorState,
    samples: tuple[NDArray[np.float64], NDArray[np.float64]],
    delivered: NDArray[np.bool_],
    arrays: MonitorArrays,
) -> MonitorState:
    """Step one group through all samples and write its conclusions into the arrays of all links."""
    u, y = samples
    if knows(group.monitor, u.shape[-1]):
        concluded = (arrays.estimate, arrays.residual, arrays.threshold, arrays.phase, arrays.alarm)
        return run_compiled(group.monitor, state, group.positions, (u, y, delivered), concluded)
    u, y = (np.ascontiguousarray(one[:, group.positions].swapaxes(1, 2)) for one in samples)  # (steps, p, group)
    arrived = np.ascontiguousarray(delivered[:, group.positions])
    state, (phase, alarm, numbers) = run_monitor(group.monitor, state, (u, y), arrived, arrays.estimate.shape[-1])
    arrays.phase[:, group.positions] = phase
    arrays.alarm[:, group.positions] = alarm
    for found, target in zip(numbers, (arrays.estimate, arrays.residual, arrays.threshold), strict=True):
        target[:, group.positions] = found.swapaxes(1, 2)
    return state
