"""A plant model, which no data-driven design ever has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from monitor.errors import MonitorError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """T (1): x+ = A x + B u + E d, y = C x.

    Attributes:
        A: (n, n).
        B: (n, m) of the known inputs.
        E: (n, m_d) of the unknown inputs.
        C: (p, n).
    """

    A: NDArray[np.float64]
    B: NDArray[np.float64]
    E: NDArray[np.float64]
    C: NDArray[np.float64]

    def __post_init__(self) -> None:
        """Raise MonitorError unless the shapes fit together."""
        n = len(self.A)
        fits = self.A.shape == (n, n) and len(self.B) == n and len(self.E) == n and self.C.shape[1] == n
        if not fits:
            shapes = ", ".join(f"{name} {getattr(self, name).shape}" for name in "ABEC")
            raise MonitorError(f"the model has {shapes}, expected n rows in A, B, E and n columns in A, C")
