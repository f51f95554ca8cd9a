"""Measuring an observer: how its error decays and what its residual sees of a falsified output.

With phi added to y, and the plant at rest, z+ = A z + B_y phi and r = H z + J_y phi (theory: r_t = (I - D) phi_t -
sum_j A^j B phi_{t-1-j} for the full order).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monitor.certificate import DynamicsReport, ResidualReport, smallest_crossing
from monitor.kernel import null_space

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.linear_observer import LinearObserver

_BLIND = 1e-6  # a residual that shows less than a millionth of every falsification shows nothing
_INVISIBLE = 1e-6  # relative: steady gains below are zero
_DECAY = 0.01  # an error is gone when 1 % of it is left
_DOUBLINGS = 60  # of the summed steps: more than any Schur matrix with radius below 1 - 1e-9 needs
_NEGLIGIBLE = 1e-15  # relative: a sum has converged
_LONGEST = 20_000  # steps after which a decay or a step response is cut off


def measure_dynamics(
    A_UIO: NDArray[np.float64], strategy: str, kernel_residual: float, sampling_period_sec: float
) -> DynamicsReport:
    """Report how the error e+ = A_UIO e behaves."""
    eigenvalues = np.linalg.eigvals(A_UIO) if len(A_UIO) else np.zeros(0)
    radius = float(np.max(np.abs(eigenvalues), initial=0.0))
    steps = convergence_steps(A_UIO) if radius < 1.0 else None
    return DynamicsReport(
        strategy=strategy,
        order=len(A_UIO),
        kernel_residual=kernel_residual,
        eigenvalues=np.column_stack([eigenvalues.real, eigenvalues.imag]),
        spectral_radius=radius,
        convergence_steps=steps,
        convergence_sec=None if steps is None else steps * sampling_period_sec,
    )


def convergence_steps(A: NDArray[np.float64]) -> int | None:
    """Smallest k with |A^k| <= 1 %, by doubling and bisection; None when it takes unreasonably long."""
    if not A.size or np.linalg.norm(A, 2) == 0.0:
        return 1 if A.size else 0
    high, power = 1, A
    while np.linalg.norm(power, 2) > _DECAY:
        high, power = 2 * high, power @ power
        if high > _LONGEST or not np.isfinite(power).all():
            return None
    low = high // 2
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if np.linalg.norm(np.linalg.matrix_power(A, middle), 2) <= _DECAY else (middle, high)
    return high


def accumulated(A: NDArray[np.float64], Q: NDArray[np.float64]) -> NDArray[np.float64]:
    """P = sum_k A^k Q A'^k, that is P = A P A' + Q, for Schur A and Q >= 0, by doubling: every term adds."""
    total, power = Q, A
    for _ in range(_DOUBLINGS):
        added = power @ total @ power.T
        total, power = total + added, power @ power
        if np.linalg.norm(added) <= _NEGLIGIBLE * np.linalg.norm(total):
            break
    return total


def measure_residual(
    observer: LinearObserver, threshold: NDArray[np.float64], scale: NDArray[np.float64] | None = None
) -> ResidualReport:
    """Report what the residual of a Schur observer shows of phi.

    Args:
        observer: Schur; in scaled units when a scale is given.
        threshold: (p,) user's units.
        scale: (p,) of the outputs. Decisions are made in scaled units, the report is in the user's.
    """
    p = observer.outputs
    scale = np.ones(p) if scale is None else scale
    A, H = observer.A, observer.H
    B, J = observer.B[:, observer.inputs :], observer.J[:, observer.inputs :]
    dc_gain = J + H @ np.linalg.solve(np.eye(len(A)) - A, B)
    peak_gain = _peak_of_step(A, B, H, J, dc_gain)
    blind = bool(np.max(peak_gain, initial=0.0) < _BLIND)
    rank = 0 if blind else _normal_rank(A, B, H, J)
    hidden = np.eye(p) if blind else np.linalg.qr(scale[:, None] * null_space(dc_gain, rcond=_INVISIBLE))[0]
    return ResidualReport(
        blind=blind,
        residual_rank=rank,
        stealthy_inputs=p - rank,
        dc_gain=scale[:, None] * dc_gain / scale,
        invisible_bias=hidden,
        peak_gain=scale[:, None] * peak_gain / scale,
        threshold=threshold,
        smallest_bias=scale * smallest_crossing(peak_gain, threshold / scale),
        smallest_steady_bias=scale * smallest_crossing(dc_gain, threshold / scale),
        noise_gain=np.outer(scale, scale) * noise_covariance(observer, np.diag(scale**-2.0))[-p:, -p:],
    )


def noise_covariance(observer: LinearObserver, covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance (n + p, n + p) of (xhat, r) when white noise of this covariance (p, p) is on y."""
    m = observer.inputs
    B, through = observer.B[:, m:], np.vstack([observer.D[:, m:], observer.J[:, m:]])
    out = np.vstack([observer.M, observer.H])
    spread = accumulated(observer.A, B @ covariance @ B.T)
    found = np.asarray(through @ covariance @ through.T + out @ spread @ out.T)
    np.fill_diagonal(found, np.maximum(np.diag(found), 0.0))  # rounding may leave less than nothing
    return found


def _peak_of_step(
    A: NDArray[np.float64],
    B: NDArray[np.float64],
    H: NDArray[np.float64],
    J: NDArray[np.float64],
    dc_gain: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Largest |r_i| after a unit step in phi_j, from the summed impulse response H A^t B until it has settled."""
    peak = np.maximum(np.abs(J), np.abs(dc_gain))
    if not len(A):
        return peak
    steps = min(3 * (convergence_steps(A) or _LONGEST) + len(A), _LONGEST)
    observed, power = H[None], A
    while len(observed) < steps:
        observed, power = np.concatenate([observed, observed @ power]), power @ power
    response = J + np.cumsum(observed @ B, axis=0)
    return np.asarray(np.maximum(peak, np.max(np.abs(response), axis=0)))


def _normal_rank(A: NDArray[np.float64], B: NDArray[np.float64], H: NDArray[np.float64], J: NDArray[np.float64]) -> int:
    """Rank of the transfer matrix J + H (zI - A)^-1 B at points where no zero is to be expected."""
    points = (1.7 * np.exp(0.9j), 2.3 * np.exp(2.1j))
    identity = np.eye(len(A))
    ranks = []
    for point in points:
        gain = J + H @ np.linalg.solve(point * identity - A, B.astype(complex))
        values = np.linalg.svd(gain, compute_uv=False)
        ranks.append(int(np.count_nonzero(values > _BLIND * max(float(values[0]), _BLIND))))
    return max(ranks)
