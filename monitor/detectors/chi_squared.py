"""The whitened residual: how unusual it is as a whole, direction by direction."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass as checked_dataclass

from monitor.detectors.levels import Divisor, levels_of
from monitor.detectors.protocol import Verdict
from monitor.detectors.schedule import Progress, Schedule
from monitor.linear import anywhere, larger, select
from monitor.options import STRICT, parse_options, wrong_option

if TYPE_CHECKING:
    from collections.abc import Mapping

    from monitor.linear import Component, Flag, Vector

KIND = "chi_squared"
_SINGULAR = 1e-9  # share of its variance below which a component follows from those before it
_FEWEST = 20  # calibration samples for a covariance


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ChiSquaredOptions:
    """Options of the chi-squared detector.

    Attributes:
        settle_sec: the observer's initial error dies out, nothing is learned [s].
        calibrate_sec: attack-free stretch that the covariance is learned from [s].
        rate: share of attack-free samples that may raise an alarm.
        floor: smallest standard deviation, one number or one an output.
    """

    settle_sec: float = Field(default=0.5, ge=0.0)
    calibrate_sec: float = Field(default=2.0, gt=0.0)
    rate: float = Field(default=1e-4, gt=0.0, lt=1.0)
    floor: tuple[Divisor, ...] | Divisor = 1e-9


class ChiSquaredState(NamedTuple):
    """What was learned.

    Attributes:
        progress: how far it is.
        products: sums of r_i r_j, rows of the lower triangle one after the other.
        factor: the entries of L below its diagonal, rows one after the other; NaN until calibration is complete.
        pivots: p components of D.
        limit: what the statistic is compared with.
        threshold: p components: the alarm is certain above it.
    """

    progress: Progress
    products: Vector
    factor: Vector
    pivots: Vector
    limit: Component
    threshold: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class ChiSquaredDetector:
    """Alarm when r' S^-1 r > q n / (n - q + 1) F_q,n-q+1(1 - rate): Hotelling's T^2, chi-squared for long calibration.

    S = (1/n) sum r r' over n attack-free samples, S = L D L' with unit lower triangular L. The residual of a UIO has
    fewer independent directions than components: q counts the pivots of D above a singular share of their variance;
    the others are held at it, so that what never moved before still raises an alarm when it does.

    Attributes:
        schedule: settling, then n samples of calibration.
        rate: promised share of attack-free samples with an alarm.
        floor: smallest standard deviation of a component, one number or one each.
    """

    schedule: Schedule
    rate: float
    floor: tuple[float, ...] | float

    @property
    def promise(self) -> str:
        """The false-alarm promise, one line."""
        return (
            f"{self.rate:g} of the attack-free samples alarm if residuals are independent, Gaussian and of mean 0: "
            f"Hotelling's limit for a covariance learned from {self.schedule.calibrate_steps} samples"
        )

    def init(self, outputs: int) -> ChiSquaredState:
        """State before the first residual of `outputs` components.

        Raises:
            MonitorError: the floor has another number of components.
        """
        levels_of(KIND, "floor", self.floor, outputs)
        entries = outputs * (outputs + 1) // 2
        unknown = (nan,) * outputs
        return ChiSquaredState(Progress(0, 0), (0.0,) * entries, (nan,) * (entries - outputs), unknown, nan, unknown)

    def step(self, state: ChiSquaredState, residual: Vector) -> tuple[ChiSquaredState, Verdict]:
        """Take the next residual."""
        progress, stage = self.schedule.advance(state.progress, residual[0])
        alarm = stage.armed & (_statistic(state, residual) > state.limit)
        following = state._replace(progress=progress)
        if anywhere(stage.learning):
            following = self._learn(following, stage.learning, residual)
        return following, Verdict(stage.phase, following.threshold, alarm)

    def _learn(self, state: ChiSquaredState, learning: Flag, residual: Vector) -> ChiSquaredState:
        """Take the products in, and factorise when enough is seen."""
        pairs = [residual[row] * residual[column] for row in range(len(residual)) for column in range(row + 1)]
        products = tuple(
            [select(learning, before + pair, before) for before, pair in zip(state.products, pairs, strict=True)]
        )
        following = state._replace(products=products)
        complete = state.progress.learned >= self.schedule.calibrate_steps
        return self._factorised(following, complete) if anywhere(complete) else following

    def _factorised(self, state: ChiSquaredState, complete: Flag) -> ChiSquaredState:
        """S = L D L' where calibration is complete."""
        outputs = len(state.pivots)
        floor = levels_of(KIND, "floor", self.floor, outputs)
        mean = [entry / self.schedule.calibrate_steps for entry in state.products]
        variance = [mean[_at(row, row)] + floor[row] * floor[row] for row in range(outputs)]
        factor: dict[tuple[int, int], Component] = {}
        pivots: list[Component] = []
        directions: Component = 0.0
        for row in range(outputs):
            pivot = variance[row]
            for column in range(row):
                entry = mean[_at(row, column)]
                for inner in range(column):
                    entry = entry - factor[row, inner] * factor[column, inner] * pivots[inner]
                factor[row, column] = entry / pivots[column]
                pivot = pivot - factor[row, column] * factor[row, column] * pivots[column]
            least = _SINGULAR * variance[row] + floor[row] * floor[row]
            directions = directions + select(pivot > least, 1.0, 0.0)
            pivots.append(larger(pivot, least))
        limit = self._limit(directions, outputs)
        return state._replace(
            factor=tuple([select(complete, entry, nan) for entry in factor.values()]),
            pivots=tuple([select(complete, pivot, nan) for pivot in pivots]),
            limit=select(complete, limit, nan),
            threshold=tuple([select(complete, np.sqrt(limit * one), nan) for one in variance]),
        )

    def _limit(self, directions: Component, outputs: int) -> Component:
        """The limit for q directions; without any, for one."""
        from scipy.special import fdtri  # noqa: PLC0415 (slow to import)

        n = self.schedule.calibrate_steps
        limit: Component = 0.0
        for q in range(outputs, 0, -1):
            value = q * n / (n - q + 1) * float(fdtri(q, n - q + 1, 1.0 - self.rate))
            limit = select(directions <= q, value, limit)
        return limit


def _statistic(state: ChiSquaredState, residual: Vector) -> Component:
    """Compute r' S^-1 r = z' D^-1 z with L z = r."""
    z: list[Component] = []
    total: Component = 0.0
    position = 0
    for component, pivot in zip(residual, state.pivots, strict=True):
        for before in z:
            component = component - state.factor[position] * before  # noqa: PLW2901 - forward substitution
            position += 1
        z.append(component)
        total = total + component * component / pivot
    return total


def _at(row: int, column: int) -> int:
    """Place of an entry of a lower triangle whose rows stand one after the other."""
    return row * (row + 1) // 2 + column


def build(options: Mapping[str, object], sampling_period_sec: float) -> ChiSquaredDetector:
    """Build the detector from the options of a scenario.

    Raises:
        MonitorError: the calibration is too short for a covariance.
    """
    parsed = parse_options(ChiSquaredOptions, options, KIND)
    steps = round(parsed.calibrate_sec / sampling_period_sec)
    if steps < _FEWEST:
        expected = f"expected at least {_FEWEST * sampling_period_sec:g} s, {_FEWEST} samples for a covariance"
        raise wrong_option(KIND, ("calibrate_sec",), parsed.calibrate_sec, expected)
    return ChiSquaredDetector(
        schedule=Schedule(settle_steps=round(parsed.settle_sec / sampling_period_sec), calibrate_steps=steps),
        rate=parsed.rate,
        floor=parsed.floor,
    )
