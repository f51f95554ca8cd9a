"""A threshold with a stated false-alarm rate, from attack-free samples of the run itself (split conformal)."""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, inf, nan
from typing import TYPE_CHECKING, NamedTuple

from pydantic import Field
from pydantic.dataclasses import dataclass as checked_dataclass

from monitor.detectors.levels import Divisor, any_above, levels_of
from monitor.detectors.protocol import Verdict
from monitor.detectors.schedule import Progress, Schedule
from monitor.linear import anywhere, larger, select
from monitor.options import STRICT, parse_options, wrong_option

if TYPE_CHECKING:
    from collections.abc import Mapping

    from monitor.linear import Component, Flag, Vector

KIND = "calibrated"
_SCALE_SHARE = 5  # one fifth of the calibration weighs the components against each other


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class CalibratedOptions:
    """Options of the calibrated detector.

    Attributes:
        settle_sec: the observer's initial error dies out, nothing is learned [s].
        calibrate_sec: attack-free stretch that the threshold is learned from [s].
        rate: share of attack-free samples that may raise an alarm.
        floor: smallest weight of a component, one number or one an output.
    """

    settle_sec: float = Field(default=0.5, ge=0.0)
    calibrate_sec: float = Field(default=10.0, gt=0.0)
    rate: float = Field(default=0.01, gt=0.0, lt=1.0)
    floor: tuple[Divisor, ...] | Divisor = 1e-9


class CalibratedState(NamedTuple):
    """What was learned.

    Attributes:
        progress: how far it is.
        total: p components, sum of |r_i| over the first fifth.
        largest: the k largest scores of the rest, falling.
        threshold: p components, NaN until calibration is complete.
    """

    progress: Progress
    total: Vector
    largest: Vector
    threshold: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibratedDetector:
    """Alarm when the score s = max_i |r_i| / w_i exceeds the k-th largest of n attack-free scores, k = [rate (n + 1)].

    w_i is the mean |r_i| of an earlier stretch. For exchangeable scores P(s > k-th largest of n) <= k / (n + 1) <=
    rate, for every distribution, with equality where it is continuous (Vovk, Gammerman and Shafer 2005). Given one
    calibration the rate is distributed as Beta(k, n + 1 - k) around that mean. Residuals of neighbouring samples are
    correlated: the mean stays, the spread grows.

    Attributes:
        schedule: settling, then n + n/4 samples of calibration.
        weigh_steps: the first samples of the calibration, which give w.
        rate: promised share of attack-free samples with an alarm.
        kept: k.
        floor: smallest w_i, one number or one each.
    """

    schedule: Schedule
    weigh_steps: int
    rate: float
    kept: int
    floor: tuple[float, ...] | float

    @property
    def promise(self) -> str:
        """The false-alarm promise, one line."""
        n = self.schedule.calibrate_steps - self.weigh_steps
        return (
            f"at most {self.rate:g} of the attack-free samples alarm, whatever the distribution: the threshold is "
            f"number {self.kept} of {n} attack-free scores, expected rate {self.kept / (n + 1):.3g}"
        )

    def init(self, outputs: int) -> CalibratedState:
        """State before the first residual of `outputs` components.

        Raises:
            MonitorError: the floor has another number of components.
        """
        levels_of(KIND, "floor", self.floor, outputs)
        return CalibratedState(Progress(0, 0), (0.0,) * outputs, (-inf,) * self.kept, (nan,) * outputs)

    def step(self, state: CalibratedState, residual: Vector) -> tuple[CalibratedState, Verdict]:
        """Take the next residual."""
        progress, stage = self.schedule.advance(state.progress, residual[0])
        magnitude = tuple([abs(component) for component in residual])
        alarm = stage.armed & any_above(magnitude, state.threshold)
        following = state._replace(progress=progress)
        if anywhere(stage.learning):
            following = self._learn(state, progress, stage.learning, magnitude)
        return following, Verdict(stage.phase, following.threshold, alarm)

    def _learn(
        self, state: CalibratedState, progress: Progress, learning: Flag, magnitude: tuple[Component, ...]
    ) -> CalibratedState:
        """Take the magnitudes into the weights first, then into the largest scores."""
        weighing = learning & (progress.learned <= self.weigh_steps)
        scoring = learning & (progress.learned > self.weigh_steps)
        total = tuple(
            [select(weighing, before + value, before) for before, value in zip(state.total, magnitude, strict=True)]
        )
        levels = levels_of(KIND, "floor", self.floor, len(magnitude))
        weights = [larger(one / self.weigh_steps, least) for one, least in zip(total, levels, strict=True)]
        score: Component = -inf
        for value, weight in zip(magnitude, weights, strict=True):
            score = larger(score, value / weight)
        largest = _inserted(state.largest, select(scoring, score, -inf))
        complete = progress.learned >= self.schedule.calibrate_steps
        threshold = tuple([select(complete, largest[-1] * weight, nan) for weight in weights])
        return CalibratedState(progress, total, largest, threshold)


def _inserted(falling: Vector, value: Component) -> tuple[Component, ...]:
    """The largest of a falling list and one more, falling."""
    kept: list[Component] = []
    for one in falling:
        smaller = one < value
        kept.append(select(smaller, value, one))
        value = select(smaller, one, value)
    return tuple(kept)


def build(options: Mapping[str, object], sampling_period_sec: float) -> CalibratedDetector:
    """Build the detector from the options of a scenario.

    Raises:
        MonitorError: the calibration is too short for the rate.
    """
    parsed = parse_options(CalibratedOptions, options, KIND)
    steps = round(parsed.calibrate_sec / sampling_period_sec)
    weigh = max(1, steps // _SCALE_SHARE)
    kept = floor(parsed.rate * (steps - weigh + 1) * (1.0 + 1e-12))  # 0.01 * 100 is 1, whatever its rounding
    if kept < 1:
        needed = sampling_period_sec * _SCALE_SHARE / (_SCALE_SHARE - 1) / parsed.rate
        expected = f"expected at least {needed:.4g} s to promise a rate of {parsed.rate:g}"
        raise wrong_option(KIND, ("calibrate_sec",), parsed.calibrate_sec, expected)
    return CalibratedDetector(
        schedule=Schedule(settle_steps=round(parsed.settle_sec / sampling_period_sec), calibrate_steps=steps),
        weigh_steps=weigh,
        rate=parsed.rate,
        kept=kept,
        floor=parsed.floor,
    )
