"""A bias that comes and goes."""

from typing import Self

from pydantic import Field, model_validator

from dgu_sim.attacks.profile import Profile
from dgu_sim.model import Number, Vector3, finding

__all__ = ["BiasPulse"]


class BiasPulse(Profile):
    """phi = bias for the first width_sec of every period_sec, 0 in between; both in whole samples, at least one."""

    bias: Vector3 = Field(description="phi within a pulse: V [V], I_t [A], v [V s].")
    period_sec: Number = Field(gt=0, description="Time from one pulse to the next [s].")
    width_sec: Number = Field(gt=0, description="Length of a pulse [s], shorter than period_sec.")

    @model_validator(mode="after")
    def _shorter(self) -> Self:
        if self.width_sec >= self.period_sec:
            raise finding(("width_sec",), self.width_sec, f"expected less than period_sec = {self.period_sec:g}")
        return self

    def phi(self, elapsed: int, sampling_period_sec: float) -> Vector3:
        """Return phi, `elapsed` samples after the first affected one."""
        width = max(1, round(self.width_sec / sampling_period_sec))
        period = max(1, round(self.period_sec / sampling_period_sec))
        return self.bias if elapsed % period < width else (0.0, 0.0, 0.0)
