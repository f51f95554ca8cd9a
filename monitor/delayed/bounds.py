"""What a gain is worth: guaranteed bounds on the error under bounded unknown inputs, and the inputs that come closest.

Error dynamics C (4): e_k+1 = Q e_k + sum_j N_j w_k+j, Q = A - L Theta, [N_0 … N_delta] = L Gamma - Phi.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monitor.sight import accumulated

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.delayed.model import Model, Window

_NEGLIGIBLE = 1e-13  # a response is cut off where what is left of it is this small a share of its sum
_LONGEST = 100_000
_ASCENT = 200  # steps of the ascent to the worst direction
_CLOSE = 1e-12  # the ascent has ended


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorResponse:
    """H e as a response to w: z_K = sum_l G_l w_K-1+delta-l.

    Attributes:
        G: (length, rows of H, q).
        ended: what is left of it is rounding.
    """

    G: NDArray[np.float64]
    ended: bool = True

    @property
    def guaranteed(self) -> float:
        """sum_l |G_l|: |H e| never exceeds it times sup |w| in the limit; infinite when the response did not end."""
        if not self.ended:
            return float("inf")
        return float(np.sum(np.linalg.norm(self.G, 2, axis=(1, 2)))) if self.G.size else 0.0

    def worst(self, start: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """Largest |H e| that inputs with |w_k| <= 1 reach, found from one start direction, and those inputs.

        For a fixed direction c the worst input is w = G_l' c / |G_l' c| (the sign pattern of the impulse response when
        w is one number) and reaches sum_l |G_l' c|; taking c along the error it reaches can only increase that.

        Args:
            start: (rows of H,) any direction.

        Returns:
            The error reached and the inputs (length, q), oldest first.
        """
        c, reached = start / np.linalg.norm(start), 0.0
        for _ in range(_ASCENT):
            pushed = np.einsum("lzq,z->lq", self.G, c)
            size = np.linalg.norm(pushed, axis=1, keepdims=True)
            w = np.divide(pushed, size, out=np.zeros_like(pushed), where=size > 0.0)
            error = np.einsum("lzq,lq->z", self.G, w)
            length = float(np.linalg.norm(error))
            if length <= reached * (1.0 + _CLOSE):
                break
            c, reached = error / length, length
        return reached, w[::-1]


def respond(model: Model, window: Window, L: NDArray[np.float64], H: NDArray[np.float64]) -> ErrorResponse:
    """Impulse response from w to H e of a stable gain."""
    q, delay = model.B.shape[1], window.delay
    Q = model.A - L @ window.Theta
    N = np.split(L @ window.Gamma - window.Phi, delay + 1, axis=1)
    state, terms, total, ended = np.zeros((len(Q), q)), [], 0.0, False
    for lag in range(_LONGEST):
        state = Q @ state + (N[delay - lag] if lag <= delay else 0.0)
        terms.append(H @ state)
        total += float(np.linalg.norm(state, 2)) if q else 0.0
        ended = lag > delay and bool(np.linalg.norm(state) <= _NEGLIGIBLE * total)
        if ended:
            break
    return ErrorResponse(G=np.array(terms), ended=ended)


def respond_input(model: Model, window: Window, L: NDArray[np.float64]) -> ErrorResponse:
    """Response of w^_k - w_k = G^+ [e_k+1 - A e_k; -C e_k] to w, from that of e."""
    found = respond(model, window, L, np.eye(len(model.A)))
    states = found.G
    inverse = np.linalg.pinv(model.G)
    to_next, to_now = inverse[:, : len(model.A)], -inverse @ np.vstack([model.A, model.C])
    earlier = np.concatenate([np.zeros_like(states[:1]), states])
    later = np.concatenate([states, np.zeros_like(states[:1])])
    return ErrorResponse(G=to_next @ later + to_now @ earlier, ended=found.ended)


def certify(model: Model, window: Window, L: NDArray[np.float64], H: NDArray[np.float64]) -> tuple[float, float]:
    """Smallest mu with limsup |H e| <= sqrt(mu) sup |W| that C's LMI proves for this gain, and its a.

    For a fixed gain the tightest P^-1 of the LMI solves X = Q X Q' / (1 - a) + N N' / a, so mu = lambda_max(H X H'):
    a Lyapunov equation instead of a solver's word.
    """
    from scipy.optimize import minimize_scalar  # noqa: PLC0415 (slow to import)

    Q, N = model.A - L @ window.Theta, L @ window.Gamma - window.Phi
    radius = float(np.max(np.abs(np.linalg.eigvals(Q)), initial=0.0))
    if np.linalg.norm(N) == 0.0:
        return 0.0, 0.5

    def mu(a: float) -> float:
        X = accumulated(Q / np.sqrt(1.0 - a), N @ N.T / a)
        return float(np.linalg.eigvalsh(H @ X @ H.T)[-1])

    ceiling = (1.0 - radius**2) * (1.0 - 1e-9)
    found = minimize_scalar(mu, bounds=(1e-6 * ceiling, ceiling), method="bounded", options={"xatol": 1e-6})
    return max(float(found.fun), 0.0), float(found.x)
