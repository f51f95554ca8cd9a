"""A model of the plant from history alone, exact up to the coordinates of the unknown input.

The history obeys X_f = A X_p + B W + B_u U with W unknown. For any F and any invertible G the substitution
w = F x + G w' + F_u u + w_mean gives another model (A + B F, B G, C + D F, D G, …) with the same trajectories, so data
can never tell them apart. We take the one representative in which, over the history, w' is uncorrelated with x, u and
the constant, and its largest norm is 1:

    [A B_u b] = X_f [X_p; U_p; 1]^+,   R = X_f - [A B_u b] [X_p; U_p; 1] = U S V',   B = U_1 S_1 V_1' max|w'| …

F is the sample correlation of w with x, so it vanishes like 1 / sqrt(N) when the experiment draws w independently of
the past, and is exactly 0 for an orthogonal experiment. Everything that cancels w altogether (the rank conditions, the
exact gains, the zeros, an attack reconstructed next to w) is the same in all coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monitor.delayed.model import Model

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.behaviour import Behaviour
    from monitor.history import DataMatrices


@dataclass(frozen=True, slots=True, kw_only=True)
class Representative:
    """The model and the unknown inputs of the history in its coordinates.

    Attributes:
        model: first known input is the constant 1, then u; D_u = 0.
        W: (m_d, N) unknown inputs w' of every column, largest norm 1.
    """

    model: Model
    W: NDArray[np.float64]


def represent(data: DataMatrices, C: NDArray[np.float64], unknown_inputs: int) -> Representative:
    """Model of the history in the coordinates of this page.

    Args:
        data: pairs of consecutive samples with [X_p; U_p; 1] of full row rank.
        C: (p, n) output map.
        unknown_inputs: m_d as decided.
    """
    n, N = data.X_p.shape
    regressors = np.vstack([data.X_p, np.ones((1, N)), data.U_p])
    coefficients = data.X_f @ np.linalg.pinv(regressors)
    left, values, right = np.linalg.svd(data.X_f - coefficients @ regressors, full_matrices=False)
    directions = left[:, :unknown_inputs] * values[:unknown_inputs]
    W = right[:unknown_inputs]
    largest = float(np.max(np.linalg.norm(W, axis=0), initial=0.0)) if unknown_inputs else 1.0
    known = coefficients.shape[1] - n
    model = Model(
        A=coefficients[:, :n],
        B=directions * largest,
        C=C,
        D=np.zeros((len(C), unknown_inputs)),
        B_u=coefficients[:, n:],
        D_u=np.zeros((len(C), known)),
    )
    return Representative(model=model, W=W / largest)


def represent_behaviour(data: DataMatrices, behaviour: Behaviour) -> Model:
    """Model of what remains of a noisy history once the noise is taken off, up to F and G, operating point included.

    What cancels w altogether is the same in all coordinates, so an operating point that came with w may stay in it:
    one regressor less, and the maximum-likelihood behaviour in place of least squares. |w'| = 1 is the largest of the
    history, from 0.
    """
    n = len(behaviour.L_x)
    regressors = np.vstack([behaviour.L_x, behaviour.L_u])
    coefficients = behaviour.L_xf @ np.linalg.pinv(regressors)
    left, values, _ = np.linalg.svd(behaviour.L_xf - coefficients @ regressors, full_matrices=False)
    count = behaviour.unknown_inputs
    B = left[:, :count] * values[:count]
    W = np.linalg.pinv(B) @ (data.X_f - coefficients @ np.vstack([data.X_p, data.U_p]))
    largest = float(np.max(np.linalg.norm(W, axis=0), initial=0.0)) if count else 1.0
    known = coefficients.shape[1] - n
    return Model(
        A=coefficients[:, :n],
        B=B * largest,
        C=behaviour.C,
        D=np.zeros((len(behaviour.C), count)),
        B_u=coefficients[:, n:],
        D_u=np.zeros((len(behaviour.C), known)),
    )


def with_attacks(model: Model, attacked: tuple[int, ...], bound: NDArray[np.float64] | float) -> Model:
    """Append a bounded falsification of some outputs to the unknown inputs: B gets zeros, D picks the channels.

    Args:
        model: the plant.
        attacked: positions in y.
        bound: size [units of y] of an attack that counts as |w| = 1, one number or one an output.
    """
    picked = np.diag(np.broadcast_to(bound, len(model.C)))[:, list(attacked)]
    return Model(
        A=model.A,
        B=np.hstack([model.B, np.zeros((len(model.A), len(attacked)))]),
        C=model.C,
        D=np.hstack([model.D, picked]),
        B_u=model.B_u,
        D_u=model.D_u,
    )
