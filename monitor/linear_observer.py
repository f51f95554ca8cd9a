"""The running part of every linear observer: four matrix products a step."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from monitor.batch import Estimates, run_linear
from monitor.linear import Component, Matrix, Vector, matvec, rows_of
from monitor.observer import Estimate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearObserver:
    """Observer in state form, T (2) and (14), the same for full and reduced order.

    z_t+1 = A z_t + B v_t,  xhat_t = M z_t + D v_t,  r_t = H z_t + J v_t,  z_0 = Z v_0,  v = (u, y).

    Attributes:
        A: (q, q) error dynamics A_UIO.
        B: (q, m + p).
        M: (n, q).
        D: (n, m + p).
        H: (p, q) residual from the state.
        J: (p, m + p) residual from what is received.
        Z: (q, m + p) start: the first estimate is the pseudo-inverse guess, y_0 itself for C = I.
        inputs: m.
        outputs: p.
        lag: steps by which the estimate lags the newest sample.
    """

    A: NDArray[np.float64]
    B: NDArray[np.float64]
    M: NDArray[np.float64]
    D: NDArray[np.float64]
    H: NDArray[np.float64]
    J: NDArray[np.float64]
    Z: NDArray[np.float64]
    inputs: int
    outputs: int
    lag: int = 0
    _start: Matrix = field(init=False, repr=False, compare=False)
    _whole: Matrix = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Lay the matrices out for stepping."""
        whole = np.block([[self.H, self.J], [self.M, self.D], [self.A, self.B]])
        object.__setattr__(self, "_start", rows_of(self.Z))
        object.__setattr__(self, "_whole", rows_of(whole))

    @property
    def states(self) -> int:
        """Number n of estimated states."""
        return len(self.M)

    @property
    def order(self) -> int:
        """Order q of the observer."""
        return len(self.A)

    def matrices(self) -> dict[str, NDArray[np.float64]]:
        """The matrices by their symbols."""
        return {"A": self.A, "B": self.B, "M": self.M, "D": self.D, "H": self.H, "J": self.J, "Z": self.Z}

    def init(self, u: Sequence[Component], y: Sequence[Component]) -> Vector:
        """State before the first sample is used: z_0 = Z (u_0, y_0)."""
        return matvec(self._start, (*u, *y))

    def step(self, state: Vector, u: Sequence[Component], y: Sequence[Component]) -> tuple[Vector, Estimate]:
        """Estimate x_t and the residual from the samples up to t, and advance."""
        out = matvec(self._whole, (*state, *u, *y))
        p, known = self.outputs, self.outputs + self.states
        return out[known:], Estimate(estimate=out[p:known], residual=out[:p])

    def run(self, u: ArrayLike | None, y: ArrayLike, x0: ArrayLike | None = None) -> Estimates:
        """Run over a whole recording: what `step` gives one by one, bit for bit.

        Args:
            u: known inputs, shape (T, m); None: there are none.
            y: received outputs, shape (T, p).
            x0: first estimate, shape (n,), units of x; None: what `init` starts with.

        Returns:
            estimate (T, n) and residual (T, p).

        Raises:
            HistoryError: the arrays do not have the columns that the observer was designed for, or x0 not n numbers.
        """
        return run_linear(self, u, y, x0)
