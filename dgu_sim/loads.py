"""Load currents: what a DGU's consumers draw, as a function of the step."""

from collections.abc import Callable
from functools import cached_property
from typing import Annotated, Literal, Protocol, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from dgu_sim.linear import FloatArray
from dgu_sim.model import Frozen, Number, finding
from dgu_sim.signals import BLOCK, RandomSource, first_step
from dgu_sim.table import Table

__all__ = [
    "ConstantLoad",
    "GaussianLoad",
    "Load",
    "LoadModel",
    "RampLoad",
    "StepLoad",
    "TableLoad",
    "UniformLoad",
    "hold_steps",
]

Hold = Annotated[float | None, Field(gt=0, description="Time a drawn value is held [s]; default: one sampling period.")]


class LoadModel(Protocol):
    """What every load can say."""

    def current(self, first: int, count: int, sampling_period_sec: float, source: RandomSource) -> FloatArray:
        """Return the current [A] held over steps first ... first+count-1, shape (count,)."""
        ...

    def nominal(self) -> float:
        """Return the mean current at t = 0 [A]: the operating value."""
        ...


class ConstantLoad(Frozen):
    """I_L(t) = current_a."""

    kind: Literal["constant"] = Field(description="A constant current.")
    current_a: Number = Field(description="Current drawn [A].")

    def current(self, first: int, count: int, sampling_period_sec: float, source: RandomSource) -> FloatArray:
        """Return the current [A], shape (count,)."""
        del first, sampling_period_sec, source
        return np.full(count, self.current_a)

    def nominal(self) -> float:
        """Return the current at t = 0 [A]."""
        return self.current_a


class StepLoad(Frozen):
    """I_L(t) = current_a for t >= at_sec, 0 before."""

    kind: Literal["step"] = Field(description="A current that is switched on.")
    current_a: Number = Field(description="Current drawn from at_sec on [A]; negative to take load away.")
    at_sec: Number = Field(ge=0, description="Time of the step [s].")

    def current(self, first: int, count: int, sampling_period_sec: float, source: RandomSource) -> FloatArray:
        """Return the current [A], shape (count,)."""
        del source
        return np.where(_steps(first, count) >= first_step(self.at_sec, sampling_period_sec), self.current_a, 0.0)

    def nominal(self) -> float:
        """Return the current at t = 0 [A]."""
        return self.current_a if self.at_sec <= 0.0 else 0.0


class RampLoad(Frozen):
    """I_L(t) rises linearly from 0 at start_sec to current_a at stop_sec and stays there."""

    kind: Literal["ramp"] = Field(description="A current that rises linearly and stays.")
    current_a: Number = Field(description="Current drawn from stop_sec on [A].")
    start_sec: Number = Field(ge=0, description="Begin of the ramp [s].")
    stop_sec: Number = Field(gt=0, description="End of the ramp [s], after start_sec.")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.stop_sec > self.start_sec:
            raise finding(("stop_sec",), self.stop_sec, f"expected a time after start_sec = {self.start_sec:g}")
        return self

    def current(self, first: int, count: int, sampling_period_sec: float, source: RandomSource) -> FloatArray:
        """Return the current [A], shape (count,)."""
        del source
        t = _steps(first, count) * sampling_period_sec
        share: FloatArray = np.clip((t - self.start_sec) / (self.stop_sec - self.start_sec), 0.0, 1.0)
        return self.current_a * share

    def nominal(self) -> float:
        """Return the current at t = 0 [A]."""
        return 0.0


class UniformLoad(Frozen):
    """I_L ~ U(low_a, high_a), drawn anew every hold_sec."""

    kind: Literal["uniform"] = Field(description="A uniformly distributed random current.")
    low_a: Number = Field(description="Smallest current [A].")
    high_a: Number = Field(description="Largest current [A], not below low_a.")
    hold_sec: Hold = None

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.high_a < self.low_a:
            raise finding(("high_a",), self.high_a, f"expected at least low_a = {self.low_a:g}")
        return self

    def current(self, first: int, count: int, sampling_period_sec: float, source: RandomSource) -> FloatArray:
        """Return the current [A], shape (count,)."""
        return _drawn(source, _held(first, count, self.hold_sec, sampling_period_sec), self._draw)

    def _draw(self, generator: np.random.Generator) -> FloatArray:
        return generator.uniform(self.low_a, self.high_a, BLOCK)

    def nominal(self) -> float:
        """Return the mean current [A]."""
        return 0.5 * (self.low_a + self.high_a)


class GaussianLoad(Frozen):
    """I_L ~ N(mean_a, std_a^2), drawn anew every hold_sec."""

    kind: Literal["gaussian"] = Field(description="A normally distributed random current.")
    mean_a: Number = Field(description="Mean current [A].")
    std_a: Number = Field(ge=0, description="Standard deviation [A].")
    hold_sec: Hold = None

    def current(self, first: int, count: int, sampling_period_sec: float, source: RandomSource) -> FloatArray:
        """Return the current [A], shape (count,)."""
        return _drawn(source, _held(first, count, self.hold_sec, sampling_period_sec), self._draw)

    def _draw(self, generator: np.random.Generator) -> FloatArray:
        return generator.normal(self.mean_a, self.std_a, BLOCK)

    def nominal(self) -> float:
        """Return the mean current [A]."""
        return self.mean_a


class TableLoad(Table):
    """I_L(t) = offset_a + scale * (current_a at t), held or interpolated between the times."""

    kind: Literal["table"] = Field(description="Currents at given times.")
    current_a: tuple[Number, ...] = Field(min_length=1, description="Current at each time [A].")
    scale: Number = Field(default=1.0, description="Factor of the currents.")
    offset_a: Number = Field(default=0.0, description="Added to them [A].")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        self.check_rows("current_a", len(self.current_a))
        return self

    def current(self, first: int, count: int, sampling_period_sec: float, source: RandomSource) -> FloatArray:
        """Return the current [A], shape (count,)."""
        del source
        return self.offset_a + self.scale * self.values(self._currents, _steps(first, count), sampling_period_sec)

    def nominal(self) -> float:
        """Return the current at t = 0 [A]."""
        return float(self.offset_a + self.scale * self.values(self._currents, _steps(0, 1), 1.0)[0])

    @cached_property
    def _currents(self) -> FloatArray:
        return np.array(self.current_a)


Load: TypeAlias = Annotated[
    ConstantLoad | StepLoad | RampLoad | UniformLoad | GaussianLoad | TableLoad, Field(discriminator="kind")
]


def hold_steps(hold_sec: float | None, sampling_period_sec: float) -> int:
    """Return for how many steps a drawn value holds."""
    return 1 if hold_sec is None else max(1, round(hold_sec / sampling_period_sec))


def _steps(first: int, count: int) -> NDArray[np.int64]:
    return np.arange(first, first + count, dtype=np.int64)


def _held(first: int, count: int, hold_sec: float | None, sampling_period_sec: float) -> NDArray[np.int64]:
    """Return the number of the drawn value that holds at each step."""
    return _steps(first, count) // hold_steps(hold_sec, sampling_period_sec)


def _drawn(
    source: RandomSource, index: NDArray[np.int64], draw: Callable[[np.random.Generator], FloatArray]
) -> FloatArray:
    """Return the drawn values of these numbers, which rise."""
    values = source.values(int(index[0]), int(index[-1]) + 1, draw)
    return np.asarray(values[index - index[0]])
