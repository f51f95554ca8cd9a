"""The plant as the delayed observer sees it, and its outputs over a window of delta + 1 samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monitor.errors import MonitorError

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """x+ = A x + B w + B_u u, y = C x + D w + D_u u (C, (1)); u is known, w is not.

    Attributes:
        A: (n, n).
        B: (n, q).
        C: (p, n).
        D: (p, q).
        B_u: (n, m).
        D_u: (p, m).
    """

    A: NDArray[np.float64]
    B: NDArray[np.float64]
    C: NDArray[np.float64]
    D: NDArray[np.float64]
    B_u: NDArray[np.float64]
    D_u: NDArray[np.float64]

    def __post_init__(self) -> None:
        """Raise MonitorError unless the shapes fit and [B; D] has full column rank (assumption 2 of C)."""
        n, p, q, m = len(self.A), len(self.C), self.B.shape[1], self.B_u.shape[1]
        expected = {"A": (n, n), "B": (n, q), "C": (p, n), "D": (p, q), "B_u": (n, m), "D_u": (p, m)}
        for name, shape in expected.items():
            if getattr(self, name).shape != shape:
                raise MonitorError(f"{name} has shape {getattr(self, name).shape}, expected {shape}")
        rank = int(np.linalg.matrix_rank(_balanced(self.G))) if q else 0
        if rank < q:
            raise MonitorError(f"[B; D] has rank {rank}, expected {q}: leave out unknown inputs that act alike")

    @property
    def G(self) -> NDArray[np.float64]:  # noqa: N802 - the symbol of the paper
        """[B; D], (n + p, q)."""
        return np.vstack([self.B, self.D])


def _balanced(G: NDArray[np.float64]) -> NDArray[np.float64]:
    """G with rows, then columns of largest entry 1: whether its columns are independent is no matter of units."""
    for axis in (1, 0):
        size = np.max(np.abs(G), axis=axis, keepdims=True)
        G = G / np.where(size > 0.0, size, 1.0)
    return G


def model_of(
    A: NDArray[np.float64],
    B: NDArray[np.float64],
    C: NDArray[np.float64],
    D: NDArray[np.float64] | None = None,
) -> Model:
    """Make a model without known inputs; D is 0 unless given."""
    n, p, q = len(A), len(C), B.shape[1]
    feedthrough = np.zeros((p, q)) if D is None else D
    return Model(A=A, B=B, C=C, D=feedthrough, B_u=np.zeros((n, 0)), D_u=np.zeros((p, 0)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Y_k:k+delta = Theta x_k + Gamma W_k:k+delta + Gamma_u U_k:k+delta and x_k+1 = A x_k + Phi W_k:k+delta + B_u u_k.

    Theta, Gamma have delta + 1 block rows (the paper's (2) prints one short).

    Attributes:
        Theta: ((delta + 1) p, n).
        Gamma: ((delta + 1) p, (delta + 1) q).
        Gamma_u: ((delta + 1) p, (delta + 1) m).
        Phi: (n, (delta + 1) q) = [B 0 … 0], C (5).
        delay: delta.
    """

    Theta: NDArray[np.float64]
    Gamma: NDArray[np.float64]
    Gamma_u: NDArray[np.float64]
    Phi: NDArray[np.float64]
    delay: int


def window_of(model: Model, delay: int) -> Window:
    """Stack the outputs of delta + 1 samples."""
    if delay < 0:
        raise MonitorError(f"delay is {delay} steps, expected 0 or more")
    powers = [np.eye(len(model.A))]
    for _ in range(delay):
        powers.append(model.A @ powers[-1])
    Phi = np.hstack([model.B, np.zeros((len(model.A), delay * model.B.shape[1]))])
    return Window(
        Theta=np.vstack([model.C @ power for power in powers]),
        Gamma=_toeplitz(powers, model.C, model.B, model.D),
        Gamma_u=_toeplitz(powers, model.C, model.B_u, model.D_u),
        Phi=Phi,
        delay=delay,
    )


def _toeplitz(
    powers: list[NDArray[np.float64]], C: NDArray[np.float64], B: NDArray[np.float64], D: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Block lower-triangular matrix of the impulse response (D, C B, C A B, …)."""
    p, q = D.shape
    response = [D, *(C @ power @ B for power in powers[:-1])]
    stacked = np.zeros((len(powers) * p, len(powers) * q))
    for row in range(len(powers)):
        for column in range(row + 1):
            stacked[row * p : (row + 1) * p, column * q : (column + 1) * q] = response[row - column]
    return stacked
