"""The cyber-physical step of a DGU, written once for one DGU in floats and for all of them in arrays."""

from collections.abc import Sequence
from dataclasses import dataclass

from dgu_sim.exogenous import Exogenous, SignalBlock
from dgu_sim.linear import Component, Vector, add
from dgu_sim.plant import Plant
from dgu_sim.records import Physical, Sample
from dgu_sim.secondary import Consensus
from dgu_sim.signals import BLOCK

__all__ = ["Cell", "UnitOutput", "UnitState"]


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitState:
    """State at step k.

    Attributes:
        step: k.
        x: V [V], I_t [A], v [V s].
        alpha: Secondary correction [V].
        signals: The drawn loads and noise around step k.
    """

    step: int
    x: Vector
    alpha: Component
    signals: SignalBlock


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
    """

    plant: Plant
    consensus: Consensus | None
    exogenous: Exogenous
    reference: Component
    hidden: Vector | None = None

    def init(self) -> UnitState:
        """Return the state at step 0, alpha = 0."""
        x = self.exogenous.initial()
        return UnitState(step=0, x=x, alpha=0.0 * x[0], signals=self.exogenous.block(0))

    def output(self, state: UnitState) -> UnitOutput:
        """Return what happens at step k."""
        signals = state.signals
        offset = state.step - signals.start
        y = state.x if signals.noise is None else add(state.x, signals.noise[offset])
        return UnitOutput(
            x=state.x,
            y=y if self.hidden is None else add(y, self.hidden),
            load_current=signals.load[offset],
            reference=self.reference + state.alpha,
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
        x = self.plant.step(state.x, signals.load[offset], self.reference + state.alpha, physical)
        alpha = state.alpha
        if self.consensus is not None:
            current = state.x[1] if signals.noise is None else state.x[1] + signals.noise[offset][1]
            alpha = self.consensus.step(alpha, current, received)
        following = signals if offset + 1 < BLOCK else self.exogenous.block(state.step + 1)
        return UnitState(step=state.step + 1, x=x, alpha=alpha, signals=following)
