"""A threshold that no noise within its bound can cross."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

from pydantic import Field
from pydantic.dataclasses import dataclass as checked_dataclass

from monitor.detectors.levels import any_above, levels_of
from monitor.detectors.protocol import Verdict
from monitor.detectors.schedule import Progress, Schedule
from monitor.errors import MonitorError
from monitor.linear import anywhere, everywhere, larger
from monitor.options import STRICT, parse_options

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from monitor.linear import Component, Flag, Vector
    from monitor.observer import Observer

KIND = "noise_bound"
_LONGEST = 100_000  # samples within which an observer forgets
_FORGOTTEN = 1e-17  # share of the sum below which a response adds nothing that floats can hold
_QUIET = 50  # samples in a row that a response must be that small: a swinging one crosses zero now and then


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class NoiseBoundOptions:
    """Options of the noise-bound detector.

    Attributes:
        noise: largest |noise| on each received output, one number or one an output.
        settle_sec: time after every (re)start before it is armed [s].
        floor: added to the threshold for rounding, one number or one an output.
    """

    noise: tuple[float, ...] | float
    settle_sec: float = Field(default=0.5, ge=0.0)
    floor: tuple[float, ...] | float = 1e-9


class NoiseBoundState(NamedTuple):
    """How far it is."""

    progress: Progress


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseBoundDetector:
    """Alarm when |r_i| > rbar_i, rbar = sup_t (|g_t| + sum_(j < t) |h_j|) rhobar + floor, theory section 8.

    h_j is the observer's residual j samples after a unit impulse on the received output (h_0 = I - D, h_j =
    -A_U^(j-1) B_U for T's UIO), g_t that of an impulse at the very first sample, which also sets the observer's
    initial state. The theory's threshold is taken at its largest from arming on, so it is one number. The noise of one
    run cannot cross it as long as |rho_k| <= rhobar, whatever its distribution, if the observer's design is exact.
    An attack is seen for certain once it moves some residual by more than 2 rbar_i.

    Attributes:
        schedule: settling; nothing is calibrated.
        noise: rhobar, one number or one each.
        floor: what rounding adds, one number or one each.
        bound: rbar, p components; None until it is `matched` to an observer.
    """

    schedule: Schedule
    noise: tuple[float, ...] | float
    floor: tuple[float, ...] | float
    bound: Vector | None = None

    @property
    def promise(self) -> str:
        """The false-alarm promise, one line."""
        return (
            f"no false alarm at all while the noise stays within {self.noise!r}: the threshold is the largest residual "
            "that such noise can cause through the observer"
        )

    def matched(self, observer: Observer) -> NoiseBoundDetector:
        """Return the detector with its threshold computed for an observer, of one link or of many side by side.

        Raises:
            MonitorError: the noise has another number of components, or the observer does not forget.
        """
        return replace(self, bound=self._bound(observer))

    def init(self, outputs: int) -> NoiseBoundState:
        """State before the first residual of `outputs` components.

        Raises:
            MonitorError: the detector was not matched to an observer of that many outputs.
        """
        if self.bound is None or len(self.bound) != outputs:
            raise MonitorError(f"{KIND}: the threshold is not known yet, expected a detector matched to its observer")
        return NoiseBoundState(Progress(0, 0))

    def step(self, state: NoiseBoundState, residual: Vector) -> tuple[NoiseBoundState, Verdict]:
        """Take the next residual."""
        assert self.bound is not None  # noqa: S101 - init has checked
        progress, stage = self.schedule.advance(state.progress, residual[0])
        alarm = stage.armed & any_above([abs(component) for component in residual], self.bound)
        return NoiseBoundState(progress), Verdict(stage.phase, self.bound, alarm)

    def _bound(self, observer: Observer) -> tuple[Component, ...]:
        """Largest (|g_t| + sum_(j < t) |h_j|) rhobar over t from arming on, plus the floor."""
        outputs = observer.outputs
        noise = levels_of(KIND, "noise", self.noise, outputs)
        floor = levels_of(KIND, "floor", self.floor, outputs)
        total: list[Component] = [0.0] * outputs
        bound: list[Component] = [0.0] * outputs
        responses = zip(_response(observer, noise, first=False), _response(observer, noise, first=True), strict=True)
        quiet = 0
        for step, (later, started) in enumerate(responses):
            if step >= self.schedule.settle_steps:
                reached = [own + summed for own, summed in zip(started, total, strict=True)]
                bound = [larger(one, other) for one, other in zip(bound, reached, strict=True)]
            total = [summed + one for summed, one in zip(total, later, strict=True)]
            quiet = quiet + 1 if _forgotten(later, total) and _forgotten(started, total) else 0
            if step > self.schedule.settle_steps and quiet >= _QUIET:
                bound = [larger(one, other) for one, other in zip(bound, total, strict=True)]
                return tuple([(1.0 + 1e-12) * one + least for one, least in zip(bound, floor, strict=True)])
        raise MonitorError(f"{KIND}: the observer still answers after {_LONGEST} samples, expected one that forgets")


def _response(observer: Observer, noise: tuple[float, ...], *, first: bool) -> Iterator[list[Component]]:
    """|residual| at each sample after an impulse of the noise's size on every output, added up over the outputs.

    What the residual does without any impulse is subtracted: an observer around an operating point is affine.
    """
    outputs = observer.outputs
    known = (0.0,) * observer.inputs
    quiet = (0.0,) * outputs
    impulses = [tuple(size if one == output else 0.0 for one in range(outputs)) for output, size in enumerate(noise)]
    states = [observer.init(known, impulse if first else quiet) for impulse in impulses]
    calm_state = observer.init(known, quiet)
    for step in range(_LONGEST):
        total: list[Component] = [0.0] * outputs
        calm_state, calm = observer.step(calm_state, known, quiet)
        for output, impulse in enumerate(impulses):
            states[output], estimate = observer.step(states[output], known, quiet if step else impulse)
            moved = [one - still for one, still in zip(estimate.residual, calm.residual, strict=True)]
            total = [summed + abs(one) for summed, one in zip(total, moved, strict=True)]
        yield total


def _forgotten(response: list[Component], total: list[Component]) -> bool:
    """Whether a response is nothing against the sum, for every component and link."""
    gone: Flag = True
    for one, summed in zip(response, total, strict=True):
        gone = gone & (one <= _FORGOTTEN * summed)
    return everywhere(gone) if anywhere(gone) else False


def build(options: Mapping[str, object], sampling_period_sec: float) -> NoiseBoundDetector:
    """Build the detector from the options of a scenario; it still has to be matched to its observer."""
    parsed = parse_options(NoiseBoundOptions, options, KIND)
    return NoiseBoundDetector(
        schedule=Schedule(settle_steps=round(parsed.settle_sec / sampling_period_sec), calibrate_steps=0),
        noise=parsed.noise,
        floor=parsed.floor,
    )
