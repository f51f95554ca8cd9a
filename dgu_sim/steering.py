"""What commands change of a DGU while it runs: its load current and its reference."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from dgu_sim.commands import Command, DguCommand, LoadRamp, LoadSet, LoadStep, ReferenceSet
from dgu_sim.linear import Component

__all__ = ["DguSteering", "GridSteering", "Steering"]


class Steering(Protocol):
    """Values that stand in the place of the scenario's from the step of a command on."""

    def after(self, command: Command, step: int) -> "Steering":
        """Return what holds after a command that acts from a step on; itself when it changes nothing here."""
        ...

    def load(self, step: int, drawn: Component) -> Component:
        """Return I_L held over a step [A], from what the scenario's loads draw."""
        ...

    def reference(self, given: Component) -> Component:
        """Return V_ref [V], from the scenario's."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class _Added:
    """I = current_a min(1, (k - first_step) / steps), all of it at once for steps = 0."""

    first_step: int
    current_a: float
    steps: int

    def at(self, step: int) -> float:
        if step >= self.first_step + self.steps:
            return self.current_a
        return self.current_a * ((step - self.first_step) / self.steps)


@dataclass(frozen=True, slots=True, kw_only=True)
class DguSteering:
    """I_L = (held, or what is drawn) + sum of what was added since; V_ref = voltage_v, or the scenario's.

    Attributes:
        dgu: Number of the DGU.
        sampling_period_sec: T_s.
        held: Load current set by hand [A].
        added: What came on top, in order.
        voltage_v: V_ref set by hand [V].
    """

    dgu: int
    sampling_period_sec: float
    held: float | None = None
    added: tuple[_Added, ...] = ()
    voltage_v: float | None = None

    def after(self, command: Command, step: int) -> "DguSteering":
        """Return what holds after a command that acts from a step on."""
        if not isinstance(command, DguCommand) or command.dgu != self.dgu:
            return self
        match command:
            case LoadSet():
                return replace(self, held=command.current_a, added=())
            case LoadStep():
                return self._more(step, command.current_a, 0)
            case LoadRamp():
                return self._more(step, command.current_a, max(1, round(command.ramp_sec / self.sampling_period_sec)))
            case ReferenceSet():
                return replace(self, voltage_v=command.voltage_v)
        return self

    def load(self, step: int, drawn: Component) -> Component:
        """Return I_L held over a step [A]."""
        current = drawn if self.held is None else 0.0 * drawn + self.held
        for one in self.added:
            current = current + one.at(step)
        return current

    def reference(self, given: Component) -> Component:
        """Return V_ref [V]."""
        return given if self.voltage_v is None else self.voltage_v

    def _more(self, step: int, current_a: float, steps: int) -> "DguSteering":
        return replace(self, added=(*self.added, _Added(first_step=step, current_a=current_a, steps=steps)))


@dataclass(frozen=True, slots=True, kw_only=True)
class GridSteering:
    """All DGUs of a grid in arrays whose last axis is "DGUs": the bits of each `DguSteering`.

    Attributes:
        dgus: DGU numbers in the order of that axis.
        sampling_period_sec: T_s.
        members: What was steered, by position on that axis.
    """

    dgus: tuple[int, ...]
    sampling_period_sec: float
    members: Mapping[int, DguSteering] = field(default_factory=dict)

    def after(self, command: Command, step: int) -> "GridSteering":
        """Return what holds after a command that acts from a step on."""
        if not isinstance(command, DguCommand) or command.dgu not in self.dgus:
            return self
        position = self.dgus.index(command.dgu)
        before = self.members.get(position)
        if before is None:
            before = DguSteering(dgu=command.dgu, sampling_period_sec=self.sampling_period_sec)
        return replace(self, members={**self.members, position: before.after(command, step)})

    def load(self, step: int, drawn: Component) -> Component:
        """Return I_L held over a step, shape (..., DGUs) [A]."""
        current = np.array(drawn)
        for position, one in self.members.items():
            current[..., position] = one.load(step, current[..., position])
        return current

    def reference(self, given: Component) -> Component:
        """Return V_ref, shape (..., DGUs) [V]."""
        voltage = np.array(given)
        for position, one in self.members.items():
            voltage[..., position] = one.reference(voltage[..., position])
        return voltage
