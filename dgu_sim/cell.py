"""The cyber-physical step of a DGU, written once for one DGU in floats and for all of them in arrays."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from dgu_sim.commands import Command
from dgu_sim.exogenous import Exogenous, SignalBlock
from dgu_sim.linear import Component, Vector, add
from dgu_sim.plant import Plant
from dgu_sim.records import Physical, Sample
from dgu_sim.secondary import Consensus
from dgu_sim.signals import BLOCK
from dgu_sim.steering import Steering

__all__ = ["Cell", "UnitOutput", "UnitState"]


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitState:
    """State at step k.

    Attributes:
        step: k.
        x: V [V], I_t [A], v [V s].
        alpha: Secondary correction [V].
        signals: The drawn loads and noise around step k.
        steering: What commands have changed; None: nothing.
    """

    step: int
    x: Vector
    alpha: Component
    signals: SignalBlock
    steering: Steering | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitOutput:
    """What happens at step k.

    Attributes:
        x: V [V], I_t [A], v [V s]: the truth.
        y: The measured output, x plus noise: what is sent.
        load_current: I_L held over the sample [A].
        reference: V_ref + alpha held over the sample [V].
        alpha: Secondary correction [V].
    """

    x: Vector
    y: Vector
    load_current: Component
    reference: Component
    alpha: Component


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """Plant, secondary control and exogenous signals put together.

    Attributes:
        plant: The physics of one sample.
        consensus: Secondary control, or None when it is off: alpha stays 0.
        exogenous: Loads, noise and initial state.
        reference: V_ref [V].
        hidden: Added to the output: 0.0 for a component that is sent, NaN for one that is not; None: all are sent.
        unsteered: Where commands start from; None: there are none.
    """

    plant: Plant
    consensus: Consensus | None
    exogenous: Exogenous
    reference: Component
    hidden: Vector | None = None
    unsteered: Steering | None = None

    def init(self) -> UnitState:
        """Return the state at step 0, alpha = 0."""
        x = self.exogenous.initial()
        return UnitState(step=0, x=x, alpha=0.0 * x[0], signals=self.exogenous.block(0))

    def steer(self, state: UnitState, command: Command) -> UnitState:
        """Return the state at step k after a command that acts from step k on."""
        before = state.steering or self.unsteered
        after = None if before is None else before.after(command, state.step)
        return state if after is before else replace(state, steering=after)

    def output(self, state: UnitState) -> UnitOutput:
        """Return what happens at step k."""
        signals = state.signals
        offset = state.step - signals.start
        y = state.x if signals.noise is None else add(state.x, signals.noise[offset])
        return UnitOutput(
            x=state.x,
            y=y if self.hidden is None else add(y, self.hidden),
            load_current=self._load(state),
            reference=self._reference(state) + state.alpha,
            alpha=state.alpha,
        )

    def step(self, state: UnitState, physical: Sequence[Physical], received: Sequence[Sample]) -> UnitState:
        """Return the state at step k + 1.

        Args:
            state: The state at step k.
            physical: Step k of the physically coupled DGUs, in the order of `plant.physical_of`.
            received: Step k as received from the neighbours, ascending.
        """
        signals = state.signals
        offset = state.step - signals.start
        x = self.plant.step(state.x, self._load(state), self._reference(state) + state.alpha, physical)
        alpha = state.alpha
        if self.consensus is not None:
            current = state.x[1] if signals.noise is None else state.x[1] + signals.noise[offset][1]
            alpha = self.consensus.step(alpha, current, received)
        following = signals if offset + 1 < BLOCK else self.exogenous.block(state.step + 1)
        return UnitState(step=state.step + 1, x=x, alpha=alpha, signals=following, steering=state.steering)

    def _load(self, state: UnitState) -> Component:
        drawn = state.signals.load[state.step - state.signals.start]
        return drawn if state.steering is None else state.steering.load(state.step, drawn)

    def _reference(self, state: UnitState) -> Component:
        return self.reference if state.steering is None else state.steering.reference(self.reference)
