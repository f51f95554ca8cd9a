"""Fixed thresholds, calibrated on an attack-free stretch of the run itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass as checked_dataclass

from monitor.detectors.levels import levels_of
from monitor.detectors.protocol import Phase, Verdict
from monitor.detectors.schedule import restarted
from monitor.linear import anywhere, is_missing, larger, select
from monitor.options import STRICT, parse_options

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from monitor.linear import Component, Count, Flag, Vector

KIND = "fixed"


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class FixedOptions:
    """Options of the fixed detector.

    Attributes:
        settle_sec: the observer's initial error dies out, nothing is learned [s].
        calibrate_sec: the largest |r_i| is learned; no attack may run [s].
        margin: threshold_i = max(margin * largest |r_i|, floor_i).
        floor: smallest threshold, one number or one an output; it covers rounding and what calibration did not meet.
    """

    settle_sec: float = Field(default=0.5, ge=0.0)
    calibrate_sec: float = Field(default=2.0, ge=0.0)
    margin: float = Field(default=5.0, gt=0.0)
    floor: tuple[float, ...] | float = 1e-6


class FixedState(NamedTuple):
    """Progress through the phases.

    Attributes:
        age: samples since the observer (re)started.
        learned: samples calibration has seen.
        peak: p components, largest |r_i| seen while calibrating.
        threshold: p components, NaN until calibration is complete.
    """

    age: Count
    learned: Count
    peak: Vector
    threshold: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class FixedDetector:
    """Alarm = OR over components |r_i| > threshold_i (theory, section 8), thresholds learned once and kept.

    Phases: SETTLING, CALIBRATING, ARMED. A missing sample (residual NaN) restarts the settling, not the calibration.

    Attributes:
        settle_steps: samples without a verdict after every (re)start.
        calibrate_steps: samples that the thresholds are learned from.
        margin: factor on the largest residual learned.
        floor: smallest threshold, one number for all components or one each.
    """

    settle_steps: int
    calibrate_steps: int
    margin: float
    floor: tuple[float, ...]

    @property
    def promise(self) -> str:
        """The false-alarm promise, one line."""
        return (
            f"none that can be stated: the threshold is {self.margin:g} times the largest of {self.calibrate_steps} "
            "attack-free residuals, a rule of thumb"
        )

    def init(self, outputs: int) -> FixedState:
        """State before the first residual of `outputs` components.

        Raises:
            MonitorError: the floor has another number of components.
        """
        floor = self.levels(outputs)
        threshold = floor if self.calibrate_steps == 0 else (float("nan"),) * outputs
        return FixedState(0, 0, (0.0,) * outputs, threshold)

    def step(self, state: FixedState, residual: Vector) -> tuple[FixedState, Verdict]:
        """Take the next residual."""
        missing = is_missing(residual[0])  # observers spread a NaN to every component
        age = restarted(missing, state.age)
        settled = age > self.settle_steps
        learning = settled & (state.learned < self.calibrate_steps)
        armed = settled & (state.learned >= self.calibrate_steps)
        magnitude = tuple([abs(component) for component in residual])
        alarm: Flag = False
        for value, limit in zip(magnitude, state.threshold, strict=True):
            alarm = alarm | (value > limit)
        following = FixedState(age, state.learned, state.peak, state.threshold)
        if anywhere(learning):
            following = self._learn(following, learning, magnitude)
        phase = Phase.SETTLING.value + learning + 2 * armed
        return following, Verdict(phase, following.threshold, armed & alarm)

    def block(self, state: FixedState, residual: NDArray[np.float64]) -> tuple[FixedState, Verdict]:
        """Take many residuals at once, none of them missing: the bits of `step`."""
        steps, _, links = shape = residual.shape
        age = state.age + np.arange(1, steps + 1)[:, None] + np.zeros(links, dtype=np.int64)
        settled = age > self.settle_steps
        # whatever has settled stays so, and learns until that is enough
        learning = settled & (state.learned + np.cumsum(settled, axis=0) - settled < self.calibrate_steps)
        learned = state.learned + np.cumsum(learning, axis=0)
        armed = settled & (learned - learning >= self.calibrate_steps)
        peak, threshold = state.peak, np.broadcast_to(_spread(state.threshold, links), shape)
        if learning.any():
            seen = np.maximum.accumulate(np.where(learning[:, None], abs(residual), 0.0), axis=0)
            peaks = np.maximum(_spread(state.peak, links), seen)
            least = np.array(self.levels(residual.shape[1]))[:, None]
            complete = (learned >= self.calibrate_steps)[:, None]
            threshold = np.where(complete, larger(self.margin * peaks, least), float("nan"))
            peak = tuple(peaks[-1])
        alarm = armed & (abs(residual) > threshold).any(axis=1)
        following = FixedState(age[-1], learned[-1], peak, tuple(threshold[-1]))
        return following, Verdict(Phase.SETTLING.value + learning + 2 * armed, threshold, alarm)

    def _learn(self, state: FixedState, learning: Flag, magnitude: tuple[Component, ...]) -> FixedState:
        """Take the magnitudes into the peaks and set the thresholds when enough is seen."""
        learned = state.learned + learning
        complete = learned >= self.calibrate_steps
        peak = tuple(
            select(learning, larger(largest, value), largest)
            for largest, value in zip(state.peak, magnitude, strict=True)
        )
        threshold = tuple(
            select(complete, larger(self.margin * largest, least), float("nan"))
            for largest, least in zip(peak, self.levels(len(peak)), strict=True)
        )
        return FixedState(state.age, learned, peak, threshold)

    def levels(self, outputs: int) -> tuple[float, ...]:
        """Smallest threshold of each of `outputs` components.

        Raises:
            MonitorError: the floor has another number of components.
        """
        return levels_of(KIND, "floor", self.floor, outputs)


def _spread(vector: Vector, links: int) -> NDArray[np.float64]:
    """Components as an array, shape (components, links)."""
    return np.stack([np.broadcast_to(np.asarray(component, dtype=np.float64), (links,)) for component in vector])


def build(options: Mapping[str, object], sampling_period_sec: float) -> FixedDetector:
    """Build the detector from the options of a scenario."""
    parsed = parse_options(FixedOptions, options, KIND)
    floor = parsed.floor if isinstance(parsed.floor, tuple) else (parsed.floor,)
    return FixedDetector(
        settle_steps=round(parsed.settle_sec / sampling_period_sec),
        calibrate_steps=round(parsed.calibrate_sec / sampling_period_sec),
        margin=parsed.margin,
        floor=floor,
    )
