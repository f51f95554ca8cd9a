"""Measurement noise, added to the output of a DGU before it is sent."""

from typing import Annotated, Literal, Protocol, TypeAlias

import numpy as np
from pydantic import Field

from dgu_sim.linear import FloatArray
from dgu_sim.model import Frozen, Number, Spread3
from dgu_sim.signals import BLOCK, RandomSource

__all__ = ["GaussianNoise", "NoNoise", "Noise", "NoiseModel", "StudentNoise", "UniformNoise"]


class NoiseModel(Protocol):
    """What every noise can say."""

    def values(self, first: int, count: int, source: RandomSource) -> FloatArray:
        """Return the noise of steps first ... first+count-1, shape (count, 3)."""
        ...


class NoNoise(Frozen):
    """y = x."""

    kind: Literal["none"] = Field(default="none", description="No measurement noise.")


class UniformNoise(Frozen):
    """y = x + rho, rho_k ~ U(-half_width_k, half_width_k)."""

    kind: Literal["uniform"] = Field(description="Uniformly distributed noise, independent in time and component.")
    half_width: Spread3 = Field(description="Largest noise on V [V], I_t [A], v [V s].")

    def values(self, first: int, count: int, source: RandomSource) -> FloatArray:
        """Return the noise of steps first ... first+count-1, shape (count, 3)."""
        return source.values(first, first + count, self._draw)

    def _draw(self, generator: np.random.Generator) -> FloatArray:
        return generator.uniform(-1.0, 1.0, (BLOCK, 3)) * self.half_width


class GaussianNoise(Frozen):
    """y = x + rho, rho_k ~ N(0, std_k^2)."""

    kind: Literal["gaussian"] = Field(description="Normally distributed noise, independent in time and component.")
    std: Spread3 = Field(description="Standard deviation on V [V], I_t [A], v [V s].")

    def values(self, first: int, count: int, source: RandomSource) -> FloatArray:
        """Return the noise of steps first ... first+count-1, shape (count, 3)."""
        return source.values(first, first + count, self._draw)

    def _draw(self, generator: np.random.Generator) -> FloatArray:
        return generator.standard_normal((BLOCK, 3)) * self.std


class StudentNoise(Frozen):
    """y = x + rho, rho_k = scale_k t, t with Student's distribution: rare large values, as of a loose contact."""

    kind: Literal["student"] = Field(description="Noise with heavy tails, independent in time and component.")
    scale: Spread3 = Field(description="Scale on V [V], I_t [A], v [V s].")
    freedom: Number = Field(default=3.0, gt=0, description="Degrees of freedom: the fewer, the heavier the tails.")

    def values(self, first: int, count: int, source: RandomSource) -> FloatArray:
        """Return the noise of steps first ... first+count-1, shape (count, 3)."""
        return source.values(first, first + count, self._draw)

    def _draw(self, generator: np.random.Generator) -> FloatArray:
        return generator.standard_t(self.freedom, (BLOCK, 3)) * self.scale


Noise: TypeAlias = Annotated[NoNoise | UniformNoise | GaussianNoise | StudentNoise, Field(discriminator="kind")]
