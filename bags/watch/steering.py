"""What commands change of the monitors while a run goes on."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from bags.watch.monitors import MonitorArrays, RunMonitors
from dgu_sim.commands import (
    Command,
    DetectorCommand,
    DetectorOff,
    DetectorOn,
    DetectorRecalibrate,
    DetectorThreshold,
    ResponseCommand,
    ResponseOff,
)
from dgu_sim.grid import Link
from monitor.combined import DguMonitor, DguState
from monitor.judging import Judging, begun_again, overruled
from monitor.link_monitor import MonitorState

__all__ = ["Given", "LaneSteering", "steer_monitor"]

Given: TypeAlias = Mapping[int, Sequence[Command]]
"""Commands by the row of a block of steps from which on they act."""


def steer_monitor(monitor: DguMonitor, state: DguState, dgu: int, sources: Sequence[int], command: Command) -> DguState:
    """Return the state of one DGU's monitor after a command that acts from the next step on.

    Args:
        monitor: The monitor.
        state: Its state.
        dgu: The DGU.
        sources: The DGUs that it receives from, ascending.
        command: The command; one on something else changes nothing.
    """
    if isinstance(command, ResponseCommand) and command.dgu in {None, dgu}:
        return state._replace(responds=not isinstance(command, ResponseOff))
    if not isinstance(command, DetectorCommand):
        return state
    for slot, source in enumerate(sources):
        if not _means(command, Link(source, dgu)):
            continue
        if isinstance(command, DetectorRecalibrate):
            state = monitor.recalibrated(state, slot)
        else:
            before = state.links[slot].judging or Judging()
            state = monitor.overruled(state, slot, _judging(before, command))
    return state


@dataclass(slots=True)
class LaneSteering:
    """The detectors of links that step side by side, overruled link by link.

    Attributes:
        links: The links, in the order of the lanes.
        judging: What was said by hand, by the position of the link.
    """

    links: Sequence[Link]
    judging: dict[int, Judging] = field(default_factory=dict)

    def take(self, command: Command, lanes: RunMonitors, states: tuple[MonitorState, ...]) -> tuple[MonitorState, ...]:
        """Return the states of all groups of lanes after a command that acts from the next step on."""
        if not isinstance(command, DetectorCommand):
            return states
        meant = [position for position, link in enumerate(self.links) if _means(command, link)]
        if not isinstance(command, DetectorRecalibrate):
            self.judging |= {one: _judging(self.judging.get(one, Judging()), command) for one in meant}
            return states
        for one in meant:
            self.judging.pop(one, None)
        following = []
        for group, state in zip(lanes.groups, states, strict=True):
            fresh = group.monitor.init().detector
            again = np.isin(group.positions, meant)
            following.append(state._replace(detector=begun_again(state.detector, fresh, again)))
        return tuple(following)

    def overrule(self, arrays: MonitorArrays) -> None:
        """Write what is told into the arrays of what the detectors themselves said, shape (steps, links, ...)."""
        for position, judging in self.judging.items():
            residual, threshold = arrays.residual[:, position], arrays.threshold[:, position]
            phase, alarm, limits = overruled(
                judging, arrays.phase[:, position].astype(np.int64), arrays.alarm[:, position], residual.T, threshold.T
            )
            arrays.phase[:, position], arrays.alarm[:, position] = phase, alarm
            for component, limit in enumerate(limits):
                threshold[:, component] = limit


def _means(command: DetectorCommand, link: Link) -> bool:
    return link in command.named_links or command.dgu == link.target


def _judging(before: Judging, command: DetectorCommand) -> Judging:
    match command:
        case DetectorThreshold():
            return before._replace(threshold=command.limits)
        case DetectorOff():
            return before._replace(off=True)
        case DetectorOn():
            return before._replace(off=False)
    return before
