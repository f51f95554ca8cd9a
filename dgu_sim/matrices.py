"""State-space matrices of a DGU and of the whole grid, continuous and sampled."""

from functools import lru_cache

import numpy as np

from dgu_sim.exponential import expm
from dgu_sim.grid import Grid
from dgu_sim.linear import FloatArray
from dgu_sim.parameters import DguParameters

__all__ = ["continuous", "continuous_joint", "discretise"]

STATES = 3
INPUTS = 2


def continuous(parameters: DguParameters, conductance_s: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Return A_c (3, 3) and E_c (3, 2) of one DGU with its primary controller, T (17).

    x = [V, I_t, v] in V, A, V s;  d = [I_net + I_L, V_ref + alpha] in A, V;

        A_c = [[-sum_j 1/(R_ij C_t), 1/C_t, 0], [(k1-1)/L_t, (k2-R_t)/L_t, k3/L_t], [-1, 0, 0]],
        E_c = [[-1/C_t, 0], [0, 0], [0, 1]].

    Args:
        parameters: The DGU.
        conductance_s: sum_j 1/R_ij of its lines [S] when they are part of A (coupling `held`); 0 in T.
    """
    p = parameters
    A_c = np.array(
        [
            [-conductance_s / p.C_t, 1.0 / p.C_t, 0.0],
            [(p.k1 - 1.0) / p.L_t, (p.k2 - p.R_t) / p.L_t, p.k3 / p.L_t],
            [-1.0, 0.0, 0.0],
        ]
    )
    E_c = np.array([[-1.0 / p.C_t, 0.0], [0.0, 0.0], [0.0, 1.0]])
    return A_c, E_c


def continuous_joint(grid: Grid) -> tuple[FloatArray, FloatArray]:
    """Return A_c (3N, 3N) and E_c (3N, 2N) of the coupled grid with line currents (V_i - V_j) / R_ij.

    States are [x_1, ..., x_N], inputs [w_1, ..., w_N] with w_i = [I_L,i, V_ref,i + alpha_i].
    """
    N = len(grid.dgus)
    A_c = np.zeros((STATES * N, STATES * N))
    E_c = np.zeros((STATES * N, INPUTS * N))
    for i, dgu in enumerate(grid.dgus):
        conductances = grid.conductances(dgu)
        own = slice(STATES * i, STATES * (i + 1))
        A_c[own, own], E_c[own, INPUTS * i : INPUTS * (i + 1)] = continuous(
            grid.parameters[dgu], sum(conductances.values())
        )
        for other, conductance in conductances.items():
            A_c[STATES * i, STATES * grid.dgus.index(other)] = conductance / grid.parameters[dgu].C_t
    return A_c, E_c


def discretise(A_c: FloatArray, E_c: FloatArray, sampling_period_sec: float) -> tuple[FloatArray, FloatArray]:
    """Sample x' = A_c x + E_c d exactly for inputs held over a sample, T (18).

        [A E; 0 I] = expm([A_c E_c; 0 0] T_s)

    Args:
        A_c: Shape (n, n).
        E_c: Shape (n, m).
        sampling_period_sec: T_s.

    Returns:
        A (n, n) and E (n, m) of x+ = A x + E d.
    """
    known = [np.asarray(one, dtype=np.float64).tobytes() for one in (A_c, E_c)]
    A, E = _sampled(*known, E_c.shape, sampling_period_sec)
    return A.copy(), E.copy()


@lru_cache(maxsize=20_000)  # most DGUs of a large grid are alike, and each is sampled for its check and its step
def _sampled(
    A_c: bytes, E_c: bytes, shape: tuple[int, int], sampling_period_sec: float
) -> tuple[FloatArray, FloatArray]:
    n, m = shape
    augmented = np.zeros((n + m, n + m))
    augmented[:n, :n], augmented[:n, n:] = np.frombuffer(A_c).reshape(n, n), np.frombuffer(E_c).reshape(n, m)
    sampled = expm(augmented * sampling_period_sec)
    return sampled[:n, :n], sampled[:n, n:]
