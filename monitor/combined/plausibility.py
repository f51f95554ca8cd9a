"""Is what a neighbour sends the answer to a plausible load and reference?"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, nan
from typing import TYPE_CHECKING, NamedTuple

from monitor.detectors.protocol import Phase
from monitor.detectors.schedule import Progress, Schedule
from monitor.linear import anywhere, everywhere, is_finite, is_missing, larger, negated, select
from monitor.options import parse_options
from monitor.settings import LimitSettings

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from monitor.input_estimators import InputEstimator
    from monitor.linear import Component, Count, Flag, Vector

OWNER = "plausibility"
_INPUTS = 2  # I_net + I_L, V_ref + alpha


class LimitState(NamedTuple):
    """What was learned and the last input.

    Attributes:
        progress: how far the schedule is.
        low: smallest inputs seen.
        high: largest inputs seen.
        fastest: largest |change| a second seen.
        last: the last input.
    """

    progress: Progress
    low: Vector
    high: Vector
    fastest: Vector
    last: Vector


class Judgement(NamedTuple):
    """What the limits say to one input; the fields are those of dcmg_msgs/InputEstimate."""

    phase: Count
    alarm: Flag
    lower: Vector
    upper: Vector
    rate: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Alarm = OR over inputs: dhat outside [low - m w - R, high + m w + R], or |change| > (1 + m) fastest + S.

    low, high, fastest and w = high - low come from an attack-free stretch, m is the margin, R and S the known range and
    rate. With m = 0 nothing but what is known is added. The share of the current that is explained, because it flows
    over the line to the DGU that judges, is taken out before and put on the limits afterwards.

    Attributes:
        schedule: settling and learning.
        sampling_period_sec: T_s.
        margin: m.
        range: R [A, V].
        rate: S [A/s, V/s], None: changes are not tested.
    """

    schedule: Schedule
    sampling_period_sec: float
    margin: float
    range: tuple[float, ...]
    rate: tuple[float, ...] | None

    @property
    def promise(self) -> str:
        """The false-alarm promise, one line."""
        current, voltage = self.range
        rates = "" if self.rate is None else f" and change at most {self.rate[0]:g} A/s, {self.rate[1]:g} V/s faster"
        known = f"no false alarm while the inputs stay within {current:g} A, {voltage:g} V of what"
        rule = "" if self.margin == 0.0 else f"; the margin of {self.margin:g} on top of it is a rule of thumb"
        return f"{known} {self.schedule.calibrate_steps} attack-free samples showed{rates}{rule}"

    def init(self) -> LimitState:
        """State before the first input."""
        nothing, unseen = (nan,) * _INPUTS, (inf,) * _INPUTS
        return LimitState(Progress(0, 0), unseen, (-inf,) * _INPUTS, (0.0,) * _INPUTS, nothing)

    def step(self, state: LimitState, input_: Vector, explained: Component = 0.0) -> tuple[LimitState, Judgement]:
        """Take the next input (NaN: there is none) and what is known of its current [A]."""
        d = (input_[0] - explained, *input_[1:])
        progress, stage = self.schedule.advance(state.progress, d[0])
        speed = tuple([abs(now - last) / self.sampling_period_sec for now, last in zip(d, state.last, strict=True)])
        low, high, fastest = state.low, state.high, state.fastest
        if anywhere(stage.learning):
            low = tuple([select(stage.learning & (one < least), one, least) for one, least in zip(d, low, strict=True)])
            high = tuple([select(stage.learning, larger(most, one), most) for one, most in zip(d, high, strict=True)])
            fastest = tuple(
                [select(stage.learning, larger(most, one), most) for one, most in zip(speed, fastest, strict=True)]
            )
        known = progress.learned >= self.schedule.calibrate_steps
        lower, upper, rate = self._limits(low, high, fastest, known)
        outside: Flag = False
        for one, fast, least, most, limit in zip(d, speed, lower, upper, rate, strict=True):
            outside = outside | (one < least) | (one > most) | (fast > limit)
        following = LimitState(progress, low, high, fastest, d)
        shown = [(limit[0] + explained, *limit[1:]) for limit in (lower, upper)]
        return following, Judgement(stage.phase, stage.armed & outside, shown[0], shown[1], rate)

    def _limits(self, low: Vector, high: Vector, fastest: Vector, known: Flag) -> tuple[Vector, Vector, Vector]:
        """Lower, upper and rate, NaN before they are known."""
        if not anywhere(known):
            return (nan,) * _INPUTS, (nan,) * _INPUTS, (nan,) * _INPUTS
        allowed = [self.margin * (most - least) + more for least, most, more in zip(low, high, self.range, strict=True)]
        lower = tuple([select(known, least - more, nan) for least, more in zip(low, allowed, strict=True)])
        upper = tuple([select(known, most + more, nan) for most, more in zip(high, allowed, strict=True)])
        more_rate = (inf,) * _INPUTS if self.rate is None else self.rate
        rate = tuple(
            [
                select(known, (1.0 + self.margin) * most + more, nan)
                for most, more in zip(fastest, more_rate, strict=True)
            ]
        )
        return lower, upper, rate


class InputState(NamedTuple):
    """State of the test on one link."""

    estimator: Vector
    limits: LimitState | None


class InputOutput(NamedTuple):
    """What the test says at one step; the fields are those of dcmg_msgs/InputEstimate."""

    phase: Count
    alarm: Flag
    input: Vector
    lower: Vector
    upper: Vector
    rate: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class PlausibilityTest:
    """An estimator of the unknown input and the limits of what is plausible, on one incoming link.

    A sample that is not delivered, or in which a component is NaN or infinite, restarts the estimator.

    Attributes:
        estimator: None when the design was refused: phase REFUSED, everything else NaN.
        limits: what is plausible.
        channels: positions in the received vector of the outputs that the estimator needs.
    """

    estimator: InputEstimator | None
    limits: Limits
    channels: tuple[int, ...]

    @property
    def lag(self) -> int:
        """Samples by which the input is behind."""
        return 0 if self.estimator is None else self.estimator.lag

    def init(self) -> InputState:
        """State before the first sample."""
        if self.estimator is None:
            return InputState((), None)
        return InputState(tuple(self.estimator.init((nan,) * self.estimator.outputs)), self.limits.init())

    def step(
        self, state: InputState, y: Sequence[Component], delivered: Flag, explained: Component = 0.0
    ) -> tuple[InputState, InputOutput]:
        """Take the sample of one step, and what is known of the current that acted `lag` samples ago [A]."""
        estimator = self.estimator
        if estimator is None or state.limits is None:
            nothing = (nan,) * _INPUTS
            return state, InputOutput(Phase.REFUSED.value, False, nothing, nothing, nothing, nothing)  # noqa: FBT003
        sent: Sequence[Component] = [y[channel] for channel in self.channels]
        usable = delivered
        for component in sent:
            usable = usable & is_finite(component)
        if not everywhere(usable):
            sent = [select(usable, component, nan) for component in sent]
        started, waiting = state.estimator, is_missing(state.estimator[0])
        if anywhere(waiting):
            fresh = estimator.init(sent)
            started = tuple([select(waiting, new, kept) for new, kept in zip(fresh, started, strict=True)])
        following, d = estimator.step(started, sent)
        if anywhere(negated(usable)):
            d = tuple([select(usable, component, nan) for component in d])
        limits, judged = self.limits.step(state.limits, d, explained)
        return InputState(following, limits), InputOutput(judged.phase, judged.alarm, d, *judged[2:])


def build_limits(options: Mapping[str, object], sampling_period_sec: float) -> Limits:
    """Build the limits from options of `LimitSettings`.

    Raises:
        MonitorError: an option that does not exist or fit.
    """
    settings = parse_options(LimitSettings, options, OWNER)
    return Limits(
        schedule=Schedule(
            settle_steps=round(settings.settle_sec / sampling_period_sec),
            calibrate_steps=max(1, round(settings.calibrate_sec / sampling_period_sec)),
        ),
        sampling_period_sec=sampling_period_sec,
        margin=settings.margin,
        range=settings.range,
        rate=settings.rate,
    )
