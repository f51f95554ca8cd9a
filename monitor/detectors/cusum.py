"""Small residuals that last: the cumulative sum of what exceeds their usual size."""

from __future__ import annotations

from dataclasses import dataclass
from math import log, nan, pi, sqrt
from typing import TYPE_CHECKING, NamedTuple

from pydantic import Field
from pydantic.dataclasses import dataclass as checked_dataclass

from monitor.detectors.levels import Divisor, any_above, levels_of
from monitor.detectors.protocol import Verdict
from monitor.detectors.schedule import Progress, Schedule
from monitor.linear import anywhere, larger, select
from monitor.options import STRICT, parse_options

if TYPE_CHECKING:
    from collections.abc import Mapping

    from monitor.linear import Component, Flag, Vector

KIND = "cusum"
_DEVIATION = sqrt(pi / 2.0)  # standard deviation over mean |r| of a Gaussian


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class CusumOptions:
    """Options of the CUSUM detector.

    Attributes:
        settle_sec: the observer's initial error dies out, nothing is learned [s].
        calibrate_sec: attack-free stretch that the residual's deviation is learned from [s].
        drift: what |r| / sigma must exceed to add up; above its mean of 0.8.
        between_sec: promised mean time between false alarms [s].
        margin: factor on the learned deviation: it is known from few samples only.
        floor: smallest deviation, one number or one an output.
    """

    settle_sec: float = Field(default=0.5, ge=0.0)
    calibrate_sec: float = Field(default=2.0, gt=0.0)
    drift: float = Field(default=1.3, gt=0.8)
    between_sec: float = Field(default=3600.0, gt=0.0)
    margin: float = Field(default=1.2, ge=1.0)
    floor: tuple[Divisor, ...] | Divisor = 1e-9


class CusumState(NamedTuple):
    """What was learned, and the sums.

    Attributes:
        progress: how far it is.
        total: p components, sum of |r_i| while calibrating.
        deviation: p components sigma_i; NaN until calibration is complete.
        sums: p components g_i.
    """

    progress: Progress
    total: Vector
    deviation: Vector
    sums: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class CusumDetector:
    """Alarm when some g_i > h, g_i <- max(0, g_i + |r_i| / sigma_i - drift) (Page 1954), g_i held at h.

    sigma_i = margin sqrt(pi/2) mean |r_i| of the calibration. With theta > 0 the root of E exp(theta (|z| - drift)) =
    2 exp(theta^2/2 - theta drift) Phi(theta) = 1, z ~ N(0, 1), the mean time to a false alarm is at least
    exp(theta h) / p samples (Lorden 1971), so h = log(p between) / theta keeps the promise, whatever the p components
    have to do with each other. Holding g at h lets an alarm end soon after its cause.

    Attributes:
        schedule: settling, then calibration.
        drift: slack in deviations.
        between_steps: promised mean number of samples between false alarms.
        theta: exponent of the bound.
        margin: factor on the learned deviation.
        floor: smallest deviation, one number or one each.
    """

    schedule: Schedule
    drift: float
    between_steps: float
    theta: float
    margin: float
    floor: tuple[float, ...] | float

    @property
    def promise(self) -> str:
        """The false-alarm promise, one line."""
        return (
            f"a mean of at least {self.between_steps:g} samples between false alarms if residuals are independent and "
            f"Gaussian of mean 0 and at most the learned deviation times {self.margin:g}: Lorden's bound"
        )

    def limit(self, outputs: int) -> float:
        """Limit h for p components."""
        return log(outputs * self.between_steps) / self.theta

    def init(self, outputs: int) -> CusumState:
        """State before the first residual of `outputs` components.

        Raises:
            MonitorError: the floor has another number of components.
        """
        levels_of(KIND, "floor", self.floor, outputs)
        zero = (0.0,) * outputs
        return CusumState(Progress(0, 0), zero, (nan,) * outputs, zero)

    def step(self, state: CusumState, residual: Vector) -> tuple[CusumState, Verdict]:
        """Take the next residual; the threshold is the |r_i| that raises an alarm now."""
        progress, stage = self.schedule.advance(state.progress, residual[0])
        limit = self.limit(len(residual))
        magnitude = tuple([abs(component) for component in residual])
        threshold = tuple(
            [
                deviation * (limit + self.drift - before)
                for deviation, before in zip(state.deviation, state.sums, strict=True)
            ]
        )
        alarm = stage.armed & any_above(magnitude, threshold)
        sums = state.sums
        if anywhere(stage.armed) or anywhere(progress.learned > 0):
            sums = tuple(
                [
                    select(stage.armed, self._grown(before, value / deviation, limit), 0.0)
                    for before, value, deviation in zip(sums, magnitude, state.deviation, strict=True)
                ]
            )
        following = state._replace(progress=progress, sums=sums)
        if anywhere(stage.learning):
            following = self._learn(following, stage.learning, magnitude)
        return following, Verdict(stage.phase, threshold, alarm)

    def _grown(self, before: Component, size: Component, limit: float) -> Component:
        """The next sum, between 0 and the limit."""
        grown = larger(before + (size - self.drift), 0.0)
        return select(grown < limit, grown, limit)

    def _learn(self, state: CusumState, learning: Flag, magnitude: tuple[Component, ...]) -> CusumState:
        """Take the magnitudes in and set the deviations when enough is seen."""
        total = tuple(
            [select(learning, before + value, before) for before, value in zip(state.total, magnitude, strict=True)]
        )
        steps = self.schedule.calibrate_steps
        complete = state.progress.learned >= steps
        factor = self.margin * _DEVIATION / steps
        levels = levels_of(KIND, "floor", self.floor, len(total))
        deviation = tuple(
            [select(complete, larger(factor * one, least), nan) for one, least in zip(total, levels, strict=True)]
        )
        return state._replace(total=total, deviation=deviation)


def exponent(drift: float) -> float:
    """Return theta > 0 with 2 exp(theta^2/2 - theta drift) Phi(theta) = 1."""
    from scipy.optimize import brentq  # noqa: PLC0415 (slow to import)
    from scipy.special import ndtr  # noqa: PLC0415 (slow to import)

    def logarithm(theta: float) -> float:
        return log(2.0 * float(ndtr(theta))) + 0.5 * theta * theta - theta * drift

    return float(brentq(logarithm, 1e-6, 2.0 * drift, xtol=1e-13))


def build(options: Mapping[str, object], sampling_period_sec: float) -> CusumDetector:
    """Build the detector from the options of a scenario."""
    parsed = parse_options(CusumOptions, options, KIND)
    return CusumDetector(
        schedule=Schedule(
            settle_steps=round(parsed.settle_sec / sampling_period_sec),
            calibrate_steps=max(1, round(parsed.calibrate_sec / sampling_period_sec)),
        ),
        drift=parsed.drift,
        between_steps=max(1.0, parsed.between_sec / sampling_period_sec),
        theta=exponent(parsed.drift),
        margin=parsed.margin,
        floor=parsed.floor,
    )
