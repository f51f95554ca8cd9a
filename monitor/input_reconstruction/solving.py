"""The gains of both estimators, once the ranks of the windows are decided."""

from __future__ import annotations

from dataclasses import replace
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from monitor.input_reconstruction.poles import Solutions, place
from monitor.input_reconstruction.realisation import Gains
from monitor.kernel import null_space
from monitor.riccati import filter_gain

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.input_reconstruction.behaviour import Behaviour
    from monitor.input_reconstruction.windows import Windows

_ROUNDING = 1e-10  # relative: directions of the past windows below it carry rounding


class Poles(Enum):
    """How op-UIE picks one of all solutions."""

    MINIMUM_NORM = "minimum_norm"
    LMI = "lmi"


def least_norm(behaviour: Behaviour, windows: Windows, tolerance: float) -> Gains:
    """[U1 Y1] = U_f H^+, and the prediction of y_t-1 from z and the outputs before it, [U2 Y2] = Y_row [U_p; Y_past]^+.

    This is op-UIE with the solution of least norm.
    """
    W0 = behaviour.u_now @ np.linalg.pinv(behaviour.H, rcond=tolerance)
    return _gains(W0, behaviour, windows)


def placed(gains: Gains, behaviour: Behaviour, windows: Windows, tolerance: float, fastest: float) -> Gains | None:
    """Op-UIE of the smallest spectral radius that the LMI finds; None when it finds no stable one.

    Args:
        gains: of least norm.
        behaviour: what the windows span.
        windows: their sizes.
        tolerance: what counts as rounding, relative to the largest singular value.
        fastest: modulus of the largest invariant zero, below which no radius can be.
    """
    left_null: NDArray[np.float64] = null_space(behaviour.H.T, rcond=tolerance)
    W0 = np.hstack([gains.U1, gains.Y1])
    found = place(Solutions(W0=W0, N=left_null.T, past_inputs=windows.past * windows.inputs), fastest)
    return None if found is None else _gains(found, behaviour, windows)


def corrected(gains: Gains, output_weight: float) -> Gains | None:
    """Dual LQR on (A_op, U2): L = A_op P U2' (R + U2 P U2')^-1, Q = I, R = output_weight I; None: no stable one."""
    n, p = len(gains.A_op), len(gains.U2)
    L = filter_gain(gains.A_op, gains.U2, np.eye(n, n + p), np.sqrt(output_weight) * np.eye(p, n + p, k=n))
    return None if L is None else replace(gains, L=L)


def _gains(W: NDArray[np.float64], behaviour: Behaviour, windows: Windows) -> Gains:
    inputs, p = windows.past * windows.inputs, windows.outputs
    prediction = behaviour.H_past[-p:] @ np.linalg.pinv(behaviour.H_past[:-p], rcond=_ROUNDING)
    U1, Y1 = np.split(W, [inputs], axis=1)
    U2, Y2 = np.split(prediction, [inputs], axis=1)
    L = np.zeros((inputs, p))
    return Gains(U1=U1, Y1=Y1, U2=U2, Y2=Y2, L=L, past=windows.past, future=windows.future)
