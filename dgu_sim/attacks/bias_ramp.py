"""A bias that grows."""

from pydantic import Field

from dgu_sim.attacks.profile import Profile
from dgu_sim.model import Number, Vector3

__all__ = ["BiasRamp"]


class BiasRamp(Profile):
    """phi = rate * min(t, rise_sec), t since the attack's start."""

    rate: Vector3 = Field(description="Growth of phi for V [V/s], I_t [A/s], v [V s/s].")
    rise_sec: Number | None = Field(
        default=None, gt=0, description="Time after which phi stays [s]; none: it grows on."
    )

    def phi(self, elapsed: int, sampling_period_sec: float) -> Vector3:
        """Return phi, `elapsed` samples after the first affected one."""
        time_sec = elapsed * sampling_period_sec
        if self.rise_sec is not None:
            time_sec = min(time_sec, self.rise_sec)
        V, I_t, v = self.rate
        return V * time_sec, I_t * time_sec, v * time_sec
