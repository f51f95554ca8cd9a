"""The running form of the delayed observer: its state is xhat_k and the samples k … k + delta - 1 in between."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from monitor.linear_observer import LinearObserver

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.delayed.model import Model, Window

_RANK = 1e-9  # relative: sensors that show the same differ by rounding only


def realise(model: Model, window: Window, L: NDArray[np.float64], R: NDArray[np.float64]) -> LinearObserver:
    """Put C (3), xhat_k+1 = Q xhat_k + L (Y - Gamma_u U) + B_u u_k, into s_t+1 = A s_t + B v_t with k = t - delta.

    The estimate at step t is xhat_t-delta+1 (for delta = 0 xhat_t, which does not use y_t yet); the residual is
    R (Y - Gamma_u U - Theta xhat_k), see `innovation`. The start repeats the first sample.
    """
    n, width, delay = len(model.A), model.B_u.shape[1] + len(model.C), window.delay
    A, B = _dynamics(model, window, L)
    if delay:
        M, D = A[:n], B[:n]
    else:
        M, D = np.eye(n), np.zeros((n, width))
    innovation = np.hstack([-R @ window.Theta, _per_sample(R, window)])
    H, J = innovation[:, :-width], innovation[:, -width:]
    return LinearObserver(
        A=A,
        B=B,
        M=M,
        D=D,
        H=H,
        J=J,
        Z=_start(model, delay),
        inputs=model.B_u.shape[1],
        outputs=len(model.C),
        lag=max(delay - 1, 0),
    )


def realise_input(model: Model, window: Window, state: LinearObserver) -> LinearObserver:
    """Take the unknown input for the estimate of the same observer (made by `realise`), k = t - delta.

    w^_k = [B; D]^+ [xhat_k+1 - A xhat_k - B_u u_k; y_k - C xhat_k - D_u u_k]
    """
    n, width = len(model.A), model.B_u.shape[1] + len(model.C)
    inverse = np.linalg.pinv(model.G)
    advance = np.hstack([state.A[:n], state.B[:n]])  # xhat_k+1 as a function of (s_t, v_t)
    now = np.eye(*advance.shape)  # xhat_k likewise
    sample = np.eye(width, advance.shape[1], k=n)  # (u_k, y_k) likewise: the oldest in memory, or v_t itself
    u, y = np.split(sample, [model.B_u.shape[1]])
    whole = inverse @ np.vstack([advance - model.A @ now - model.B_u @ u, y - model.C @ now - model.D_u @ u])
    M, D = np.split(whole, [state.order], axis=1)
    return replace(state, M=M, D=D, lag=window.delay)


def _dynamics(model: Model, window: Window, L: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A and B of s = [xhat_k; v_k; …; v_k+delta-1], v = (u, y)."""
    n, m, delay = len(model.A), model.B_u.shape[1], window.delay
    width = m + len(model.C)
    from_samples = _per_sample(L, window)
    from_samples[:, :m] += model.B_u
    Q = model.A - L @ window.Theta
    shift = np.eye(delay * width, (delay + 1) * width, k=width)
    whole = np.block([[Q, from_samples], [np.zeros((delay * width, n)), shift]])
    return whole[:, :-width], whole[:, -width:]


def _per_sample(gain: NDArray[np.float64], window: Window) -> NDArray[np.float64]:
    """Gain (Y - Gamma_u U) as a function of the samples v_k … v_k+delta, v = (u, y)."""
    rows, samples = len(gain), window.delay + 1
    from_outputs = gain.reshape(rows, samples, -1)
    from_inputs = -(gain @ window.Gamma_u).reshape(rows, samples, window.Gamma_u.shape[1] // samples)
    return np.concatenate([from_inputs, from_outputs], axis=2).reshape(rows, -1)


def _start(model: Model, delay: int) -> NDArray[np.float64]:
    """First state from the first sample: the pseudo-inverse guess, and the memory filled with that sample."""
    guess = np.linalg.pinv(model.C, rcond=_RANK) @ np.hstack([-model.D_u, np.eye(len(model.C))])
    return np.vstack([guess, *([np.eye(guess.shape[1])] * delay)])
