"""A bias that swings."""

import math

from pydantic import Field

from dgu_sim.attacks.profile import Profile
from dgu_sim.model import Number, Vector3

__all__ = ["BiasSine"]


class BiasSine(Profile):
    """phi = amplitude * sin(2 pi t / period_sec), t since the attack's start."""

    amplitude: Vector3 = Field(description="Amplitude on V [V], I_t [A], v [V s].")
    period_sec: Number = Field(gt=0, description="Time of one oscillation [s].")

    def phi(self, elapsed: int, sampling_period_sec: float) -> Vector3:
        """Return phi, `elapsed` samples after the first affected one."""
        wave = math.sin(2.0 * math.pi * elapsed * sampling_period_sec / self.period_sec)
        V, I_t, v = self.amplitude
        return V * wave, I_t * wave, v * wave
