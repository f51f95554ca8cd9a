"""One observer and one detector on one incoming link.

The records made at every step are named tuples: frozen like the dataclasses elsewhere, at a third of the cost.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import nan
from typing import TYPE_CHECKING, Any, NamedTuple

from monitor.detectors.protocol import Phase, matched
from monitor.errors import MonitorError
from monitor.judging import overruled
from monitor.linear import anywhere, everywhere, is_finite, is_missing, select

if TYPE_CHECKING:
    from collections.abc import Sequence

    from monitor.detectors.protocol import Detector
    from monitor.judging import Judging
    from monitor.linear import Component, Count, Flag, Vector
    from monitor.observer import Observer


class MonitorState(NamedTuple):
    """State of one monitor.

    Attributes:
        observer: the observer's state; NaN where it waits for a sample to start from.
        detector: the detector's state.
        judging: what was said about it by hand; None: nothing.
    """

    observer: Vector
    detector: Any
    judging: Judging | None = None


class MonitorOutput(NamedTuple):
    """What a monitor concludes at one step; vectors have as many components as the received y.

    Attributes:
        phase: a Phase number, or an array of them.
        alarm: whether the detector accuses the link.
        estimate: n components; NaN where there is none.
        residual: r = y - C xhat; NaN where the output is not sent or not delivered.
        threshold: alarm when |r| exceeds it in any component; NaN before it is set.
    """

    phase: Count
    alarm: Flag
    estimate: Vector
    residual: Vector
    threshold: Vector


@dataclass(frozen=True, slots=True)
class LinkMonitor:
    """Observer and detector on one incoming link, in floats or in arrays over (runs, links).

    A sample that is not delivered, or in which a component or a known input is NaN or infinite, counts as missing: the
    observer restarts from the next one and settles again, without recalibrating.

    Attributes:
        observer: None when the design was refused: phase REFUSED, everything else NaN.
        detector: verdict on the residual.
        channels: positions in the received vector of the outputs that the observer was designed on; the first p unless
            given.
        blind: the observer's residual shows nothing: it is used for its estimate, phase REFUSED, residual NaN.
    """

    observer: Observer | None
    detector: Detector[Any]
    channels: tuple[int, ...] | None = None
    blind: bool = False

    def __post_init__(self) -> None:
        """Fit the detector to the observer; raise MonitorError when the channels are not those of the observer."""
        if self.observer is None:
            return
        if self.channels is not None and len(self.channels) != self.observer.outputs:
            raise MonitorError(f"{len(self.channels)} channels for an observer of {self.observer.outputs} outputs")
        object.__setattr__(self, "detector", matched(self.detector, self.observer))

    def init(self) -> MonitorState:
        """State before the first sample."""
        if self.observer is None:
            return MonitorState((), None)
        waiting = tuple(self.observer.init((nan,) * self.observer.inputs, (nan,) * self.observer.outputs))
        return MonitorState(waiting, self.detector.init(self.observer.outputs))

    def step(
        self, state: MonitorState, y: Sequence[Component], delivered: Flag, u: Sequence[Component] = ()
    ) -> tuple[MonitorState, MonitorOutput]:
        """Take the sample of one step: outputs y, and the known inputs u that travel with them."""
        observer = self.observer
        if observer is None:
            return state, _refused(y, (nan,) * len(y))
        sent = y if len(y) == observer.outputs else self._sent(y, observer.outputs)
        known_inputs = u if len(u) == observer.inputs else u[: observer.inputs]
        usable = delivered
        for component in (*known_inputs, *sent):
            usable = usable & is_finite(component)
        if not everywhere(usable):
            sent = tuple([select(usable, component, nan) for component in sent])
            known_inputs = tuple([select(usable, component, nan) for component in known_inputs])
        awake = _awake(observer, state.observer, known_inputs, sent)
        following, estimate = observer.step(awake, known_inputs, sent)
        known = estimate.estimate if observer.states else (nan,) * len(y)  # an input estimator knows no state
        if self.blind:
            return state._replace(observer=following), _refused(y, known)
        learned, verdict = self.detector.step(state.detector, estimate.residual)
        residual, threshold = estimate.residual, verdict.threshold
        if len(y) != observer.outputs:
            residual, threshold = self._spread(residual, len(y)), self._spread(threshold, len(y))
        phase, alarm = verdict.phase, verdict.alarm
        if state.judging is not None:
            phase, alarm, threshold = overruled(state.judging, phase, alarm, residual, threshold)
        output = MonitorOutput(phase, alarm, known, residual, threshold)
        return MonitorState(following, learned, state.judging), output

    def recalibrated(self, state: MonitorState) -> MonitorState:
        """State of a detector that begins again; what was said about it by hand is forgotten."""
        fresh = self.init().detector
        return state._replace(detector=fresh, judging=None)

    def _sent(self, y: Sequence[Component], outputs: int) -> Sequence[Component]:
        """Components of the received vector that the observer uses."""
        return tuple([y[channel] for channel in self.channels or range(outputs)])

    def _spread(self, vector: Vector, width: int) -> Vector:
        """Put the components used back to their places in the received vector; NaN elsewhere."""
        placed: list[Component] = [nan] * width
        for channel, component in zip(self.channels or range(len(vector)), vector, strict=True):
            placed[channel] = component
        return tuple(placed)


def _awake(observer: Observer, state: Vector, u: Sequence[Component], y: Sequence[Component]) -> Vector:
    """State to step from: a fresh one where the observer waits (or lost its state to an overflow).

    NaN spreads to every component in one step, so the first one tells.
    """
    waiting: Flag = is_missing(state[0]) if len(state) else False
    if not anywhere(waiting):
        return state
    start = observer.init(u, y)
    return tuple([select(waiting, fresh, kept) for fresh, kept in zip(start, state, strict=True)])


def _refused(y: Sequence[Component], estimate: Vector) -> MonitorOutput:
    """Output of a monitor whose residual says nothing."""
    nothing = (nan,) * len(y)
    return MonitorOutput(Phase.REFUSED.value, alarm=False, estimate=estimate, residual=nothing, threshold=nothing)
