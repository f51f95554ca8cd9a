"""The running local module: residual of the own state, and the current that nothing explains."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import nan
from typing import TYPE_CHECKING, Any, NamedTuple

from monitor.detectors.protocol import Phase
from monitor.linear import Component, Flag, anywhere, is_finite, is_missing, larger, matvec, rows_of, select
from monitor.link_monitor import MonitorOutput

if TYPE_CHECKING:
    from collections.abc import Sequence

    from monitor.detectors.protocol import Detector
    from monitor.linear import Matrix, Vector
    from monitor.local.designing import LocalDesign


class LocalState(NamedTuple):
    """State of the module.

    Attributes:
        observer: the observer's state; NaN where it waits for a sample to start from.
        detector: the detector's state.
        residual: the last residual; NaN where there is none.
        learned: samples that the nominal load was learned from.
        total: sum of the loads that they showed [A].
        load: nominal load [A].
    """

    observer: Vector
    detector: Any
    residual: Vector
    learned: Component
    total: Component
    load: Component


class LocalOutput(NamedTuple):
    """What the module concludes at one step.

    Attributes:
        monitor: phase, alarm, estimate of the own state, residual and threshold.
        excess: current into the DGU between the last two samples that neither the neighbours' voltages nor the nominal
            load explain [A]; NaN where there is none.
    """

    monitor: MonitorOutput
    excess: Component


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalModule:
    """r_t+1 = (A - L) r_t + b (dI_t + sum_j phi_V,j / R_ij): what the neighbours say, or the own load, is wrong.

    dI is the deviation of the own load from its nominal value, phi_V,j the falsification of neighbour j's voltage, b
    the direction in which current acts. A falsified current or integrator is not seen here.

    Attributes:
        design: the observer and what it was made from; refused: phase REFUSED, everything else NaN.
        detector: verdict on the residual, from the moment the nominal load is known.
        learn_steps: samples from which the nominal load is learned; 0: that of the history.
        load_range: an unexplained current within it is no alarm [A].
    """

    design: LocalDesign
    detector: Detector[Any]
    learn_steps: int
    load_range: float
    _error: Matrix = field(init=False, repr=False, compare=False)
    _toward: tuple[float, ...] = field(init=False, repr=False, compare=False)  # b^+

    def __post_init__(self) -> None:
        """Lay out what every step needs; b'b is summed in order, as the bits of all else are."""
        b = self.design.load_direction.tolist()
        size = sum((one * one for one in b), 0.0)
        object.__setattr__(self, "_error", rows_of(self.design.error))
        object.__setattr__(self, "_toward", tuple([one / size for one in b]))

    def init(self) -> LocalState:
        """State before the first sample."""
        observer = self.design.observer
        if observer is None:
            return LocalState((), None, (), 0.0, 0.0, nan)
        missing = (nan,) * observer.outputs
        waiting = tuple(observer.init((nan,) * observer.inputs, missing))
        return LocalState(waiting, self.detector.init(observer.outputs), missing, 0.0, 0.0, self.design.load)

    def step(
        self, state: LocalState, y: Sequence[Component], reference: Component, voltages: Sequence[Component]
    ) -> tuple[LocalState, LocalOutput]:
        """Take the own sample of one step and what the neighbours' voltages are said to be (NaN: not received)."""
        observer = self.design.observer
        if observer is None:
            nothing = (nan,) * len(y)
            refused = MonitorOutput(Phase.REFUSED.value, False, nothing, nothing, nothing)  # noqa: FBT003 - no alarm
            return state, LocalOutput(refused, nan)
        usable: Flag = is_finite(reference)
        for component in (*y, *voltages):
            usable = usable & is_finite(component)
        own = tuple([select(usable, component, nan) for component in y])
        known = (*voltages, reference, state.load)
        waiting = is_missing(state.observer[0])
        started = state.observer
        if anywhere(waiting):
            fresh = observer.init(known, own)
            started = tuple([select(waiting, new, kept) for new, kept in zip(fresh, state.observer, strict=True)])
        following, estimate = observer.step(started, known, own)
        excess = self._excess(state.residual, estimate.residual)
        learned, total, load, ready = self._learn(state, excess)
        judged = tuple([select(ready, component, nan) for component in estimate.residual])
        detector, verdict = self.detector.step(state.detector, judged)
        beyond = (excess > self.load_range) | (excess < -self.load_range)
        output = MonitorOutput(
            verdict.phase, verdict.alarm & beyond, estimate.estimate, estimate.residual, verdict.threshold
        )
        return LocalState(following, detector, estimate.residual, learned, total, load), LocalOutput(output, excess)

    def _excess(self, before: Vector, now: Vector) -> Component:
        """b^+ (r_t - (A - L) r_(t-1)) [A]."""
        carried = matvec(self._error, before)
        total: Component = 0.0
        for weight, one, rest in zip(self._toward, now, carried, strict=True):
            total = total + weight * (one - rest)
        return total

    def _learn(self, state: LocalState, excess: Component) -> tuple[Component, Component, Component, Flag]:
        """Take one sample into the nominal load: samples, their sum, the load, and whether it is known."""
        learning = is_finite(excess) & (state.learned < self.learn_steps)
        if not anywhere(learning):
            return state.learned, state.total, state.load, state.learned >= self.learn_steps
        learned = state.learned + select(learning, 1.0, 0.0)
        total = state.total + select(learning, state.load + excess, 0.0)
        complete = learning & (learned >= self.learn_steps)
        load = select(complete, total / larger(1.0, learned), state.load)
        return learned, total, load, learned >= self.learn_steps
