"""Is the sampled closed loop of the whole grid stable?"""

from collections.abc import Sequence

import numpy as np

from dgu_sim.grid import Grid
from dgu_sim.linear import FloatArray
from dgu_sim.matrices import INPUTS, STATES, continuous, continuous_joint, discretise
from dgu_sim.plant import Coupling

__all__ = ["closed_loop", "largest_stable_gain", "sampled_grid", "spectral_radius"]

BISECTIONS = 40


def sampled_grid(grid: Grid, coupling: Coupling, sampling_period_sec: float) -> tuple[FloatArray, FloatArray]:
    """Return A (3N, 3N) and E (3N, 2N) of x+ = A x + E w for all DGUs, w_i = [I_L,i, V_ref,i + alpha_i]."""
    if coupling is Coupling.JOINT:
        return discretise(*continuous_joint(grid), sampling_period_sec)
    N = len(grid.dgus)
    A, E = np.zeros((STATES * N, STATES * N)), np.zeros((STATES * N, INPUTS * N))
    for i, dgu in enumerate(grid.dgus):
        conductances = grid.conductances(dgu) if coupling is Coupling.HELD else {}
        own = slice(STATES * i, STATES * (i + 1))
        inputs = slice(INPUTS * i, INPUTS * (i + 1))
        A_c, E_c = continuous(grid.parameters[dgu], sum(conductances.values()))
        A[own, own], E[own, inputs] = discretise(A_c, E_c, sampling_period_sec)
        for other, conductance in conductances.items():
            A[own, STATES * grid.dgus.index(other)] -= E[own, INPUTS * i] * conductance
    return A, E


def closed_loop(A: FloatArray, E: FloatArray, L: FloatArray, rated: Sequence[float], step_gain: float) -> FloatArray:
    """Return the matrix of [x; alpha]+ with secondary control, shape (4N, 4N).

        x+ = A x + E_ref alpha,    alpha+ = alpha - T_s k_I L diag(1/I^r) I_t

    Args:
        A: From `sampled_grid`.
        E: From `sampled_grid`.
        L: Graph Laplacian (N, N).
        rated: I^r of each DGU [A].
        step_gain: T_s k_I.
    """
    N = len(L)
    M = np.zeros(((STATES + 1) * N, (STATES + 1) * N))
    M[: STATES * N, : STATES * N] = A
    M[: STATES * N, STATES * N :] = E[:, 1::INPUTS]
    M[STATES * N :, 1 : STATES * N : STATES] = -step_gain * L / np.array(rated)
    M[STATES * N :, STATES * N :] = np.eye(N)
    return M


def spectral_radius(M: FloatArray, conserved: int = 0) -> float:
    """Return the largest |eigenvalue|, leaving out the `conserved` ones nearest to 1.

    1'alpha is conserved in every connected part of the grid: an eigenvalue of exactly 1 that is no instability.
    """
    eigenvalues = np.linalg.eigvals(M)
    rest = eigenvalues[np.argsort(np.abs(eigenvalues - 1.0))[conserved:]]
    return float(np.abs(rest).max(initial=0.0))


def largest_stable_gain(A: FloatArray, E: FloatArray, grid: Grid, rated: Sequence[float], step_gain: float) -> float:
    """Return, by bisection below an unstable T_s k_I, the largest stable one; 0 when there is none."""
    L, conserved = grid.laplacian(), len(grid.components())
    low, high = 0.0, step_gain
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if spectral_radius(closed_loop(A, E, L, rated, middle), conserved) < 1.0:
            low = middle
        else:
            high = middle
    return low
