"""Electrical and control parameters of one DGU."""

from dataclasses import dataclass

__all__ = ["DguParameters"]


@dataclass(frozen=True, slots=True, kw_only=True)
class DguParameters:
    """Parameters of one distributed generation unit with its primary voltage controller (T, section V).

    Attributes:
        R_t: Resistance of the output filter [ohm].
        L_t: Inductance of the output filter [H].
        C_t: Capacitance at the point of common coupling [F].
        k1: Feedback gain of the bus voltage V.
        k2: Feedback gain of the filter current I_t [ohm].
        k3: Feedback gain of the integrator v [1/s].
    """

    R_t: float
    L_t: float
    C_t: float
    k1: float
    k2: float
    k3: float

    def k3_limit(self) -> float:
        """Return (k1 - 1)(k2 - R_t) / L_t, the upper limit of k3 in the gain condition."""
        return (self.k1 - 1.0) * (self.k2 - self.R_t) / self.L_t

    def gain_violation(self) -> tuple[str, str] | None:
        """Check k1 < 1, k2 < R_t, 0 < k3 < (k1 - 1)(k2 - R_t) / L_t: the isolated DGU is then stable.

        Returns:
            None when the condition holds, else the name of the violating gain and what was expected of it.
        """
        if not self.k1 < 1.0:
            return "k1", "k1 < 1 (gain condition)"
        if not self.k2 < self.R_t:
            return "k2", f"k2 < resistance_ohm = {self.R_t:g} (gain condition)"
        if not 0.0 < self.k3 < self.k3_limit():
            return "k3", f"0 < k3 < (k1 - 1)(k2 - R_t)/L_t = {self.k3_limit():.6g} (gain condition)"
        return None
