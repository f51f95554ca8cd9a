"""Invariant zeros and unobservable modes of the true plant, by generalized eigenproblems: how far from the circle.

P(z) = [z I - A, -E; C, G] loses column rank exactly at the zeros. Its smallest singular value on the circle says how
much the plant would have to change until a zero lies there, whatever the zeros' multiplicity.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import eig

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

_POINTS = 24  # on the upper half of the circle, besides the places next to zeros
_FINITE = 1e6  # eigenvalues beyond are infinite ones, moved by rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class ZeroMargins:
    """Where the zeros are, against a circle.

    Attributes:
        circle: smallest singular value of P(z) on it.
        outside: smallest singular value of P(z) at any candidate outside it: 0 for a zero there.
    """

    circle: float
    outside: float

    @property
    def least(self) -> float:
        """How much may change before the answer may."""
        return min(self.circle, self.outside)


def zero_margins(A: Floats, E: Floats, C: Floats, G: Floats, radius: float) -> ZeroMargins:
    """Margins of the zeros of (A, E, C, G) against |z| = radius; [E; G] of full column rank."""
    scale = max(1.0, float(np.linalg.norm(A, 2)))
    candidates = _candidates(A, E, C, G)
    sizes = np.abs(candidates)
    onto = candidates[sizes > 1e-6]
    angles = np.concatenate([np.linspace(0.0, np.pi, _POINTS), np.angle(onto)])
    circle = _smallest(A, E, C, G, (radius * np.exp(1j * angles)).astype(np.complex128))
    outside = _smallest(A, E, C, G, candidates[sizes > radius])
    return ZeroMargins(circle=circle / scale, outside=outside / scale)


def _candidates(A: Floats, E: Floats, C: Floats, G: Floats) -> NDArray[np.complex128]:
    """Finite eigenvalues of two random square compressions of the pencil: all zeros are among both."""
    n, q = len(A), E.shape[1]
    if len(C) < q or not n:
        return np.zeros(0, dtype=np.complex128)
    generator = np.random.default_rng(len(C))
    constant = np.block([[A, E], [-C, -G]])
    moving = np.zeros_like(constant)
    moving[:n, :n] = np.eye(n)
    found = []
    for _ in range(1 if len(C) == q else 2):
        rows = np.linalg.qr(generator.standard_normal((n + len(C), n + q)))[0].T
        values = eig(rows @ constant, rows @ moving, right=False)
        found.append(values[np.isfinite(values) & (np.abs(values) < _FINITE)])
    return np.concatenate(found)


def _smallest(A: Floats, E: Floats, C: Floats, G: Floats, points: NDArray[np.complex128]) -> float:
    """Smallest singular value of P over some points, 1 for none and 0 with fewer rows than columns."""
    n, q = len(A), E.shape[1]
    if len(C) < q:
        return 0.0
    if not len(points) or not n + q:
        return 1.0
    pencil = np.zeros((len(points), n + len(C), n + q), dtype=np.complex128)
    pencil[:] = np.block([[-A, -E], [C, G]])
    rows = np.arange(n)
    pencil[:, rows, rows] += points[:, None]
    return float(np.min(np.linalg.svd(pencil, compute_uv=False)[:, -1]))


def half_plane_margin(A: Floats, Bbar: Floats, C: Floats) -> float:
    """Smallest singular value of [s I - A, -Bbar; C, 0] on the imaginary axis and at any candidate right of it."""
    zero = np.zeros((len(C), Bbar.shape[1]))
    candidates = _candidates(A, Bbar, C, zero)
    axis = np.concatenate([np.linspace(0.0, 5.0, _POINTS), candidates.imag])
    right = candidates[candidates.real >= 0.0]
    return _smallest(A, Bbar, C, zero, np.concatenate([1j * axis, right]))
