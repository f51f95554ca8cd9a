"""The running form of both estimators: one linear observer whose state is past input estimates and past outputs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from monitor.linear_observer import LinearObserver

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from monitor.linear import Component, Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class Gains:
    """Everything the estimators are made of; z holds the inputs at t - past … t - 1, d_y the outputs of the window.

    u_t = U1 z + Y1 d_y;  y_t-1 = U2 z + Y2 y_past, y_past the outputs at t - past … t - 2;
    z+ = [z shifted; u_t] + L (y_t-1 - U2 z - Y2 y_past).

    Attributes:
        U1: (m, past m).
        Y1: (m, (past + future) p).
        U2: (p, past m).
        Y2: (p, (past - 1) p).
        L: (past m, p); zero for op-UIE.
        past: N_ini.
        future: output samples from t on.
    """

    U1: NDArray[np.float64]
    Y1: NDArray[np.float64]
    U2: NDArray[np.float64]
    Y2: NDArray[np.float64]
    L: NDArray[np.float64]
    past: int
    future: int

    @property
    def A_op(self) -> NDArray[np.float64]:  # noqa: N802 - the symbol of the paper
        """A_op = [shift; U1], (past m, past m)."""
        m = len(self.U1)
        A_op = np.eye(self.past * m, k=m)
        A_op[-m:] = self.U1
        return A_op

    @property
    def A_z(self) -> NDArray[np.float64]:  # noqa: N802 - a matrix
        """Error dynamics A_op - L U2 of the input estimates."""
        return self.A_op - self.L @ self.U2

    @property
    def Y_residual(self) -> NDArray[np.float64]:  # noqa: N802 - a matrix
        """(p, (past + future) p): y_t-1 - Y2 y_past as a function of d_y."""
        p = len(self.U2)
        return np.hstack([-self.Y2, np.eye(p), np.zeros((p, self.future * p))])

    def in_units(self, u: NDArray[np.float64], y: NDArray[np.float64]) -> Gains:
        """The same for signals u (m,) and y (p,) times larger."""
        z, d_y = np.tile(u, self.past), np.tile(y, self.past + self.future)
        return replace(
            self,
            U1=u[:, None] * self.U1 / z,
            Y1=u[:, None] * self.Y1 / d_y,
            U2=y[:, None] * self.U2 / z,
            Y2=y[:, None] * self.Y2 / np.tile(y, self.past - 1),
            L=z[:, None] * self.L / y,
        )


def realise(gains: Gains) -> LinearObserver:
    """Put the gains into s_t+1 = A s_t + B y_t with s = [z; outputs before the newest one].

    The estimate is u at the newest output's instant minus (future - 1); the residual is that of y_t-1 before the
    correction. The start holds no input and repeats the first output.
    """
    m, p = len(gains.U1), len(gains.U2)
    inputs, length = gains.past * m, gains.past + gains.future
    B_op = np.vstack([np.zeros((inputs - m, length * p)), gains.Y1])
    from_outputs = B_op + gains.L @ gains.Y_residual
    earlier = (length - 1) * p
    shift = np.eye(earlier, length * p, k=p)
    whole = np.block([[gains.A_z, from_outputs], [np.zeros((earlier, inputs)), shift]])
    residual = np.hstack([-gains.U2, gains.Y_residual])
    A, B = whole[:, :-p], whole[:, -p:]
    pick = slice(inputs - m, inputs)
    Z = np.vstack([np.zeros((inputs, p)), np.tile(np.eye(p), (length - 1, 1))])
    return LinearObserver(
        A=A,
        B=B,
        M=A[pick],
        D=B[pick],
        H=residual[:, :-p],
        J=residual[:, -p:],
        Z=Z,
        inputs=0,
        outputs=p,
        lag=gains.future - 1,
    )


def impose(state: Vector, known: Sequence[Component], past: int) -> Vector:
    """Replace the newest input estimate in a state by an input that is known (m components)."""
    m = len(known)
    return (*state[: (past - 1) * m], *known, *state[past * m :])
