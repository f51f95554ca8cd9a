"""From the solutions of all nodes to the observer network: leader gain, coupling, error dynamics.

Node i runs D (6): z_i' = E_i z_i + F_i u_i + L_i y_i + chi_i sum_j a_ij (xhat_j - xhat_i), xhat_i = z_i + H_i y_i, with
D (21): H = T_y, F = T_u, E = T_x - Lt C for the leader, E = T_x for the others, L = Lt + E H (Lt = 0 for the others).
The errors obey e' = (diag(E_i) - (diag(chi_i) Lap) kron I) e, chi_leader = 0; in the sampled design e' means e at the
next sample, and Schur takes the place of Hurwitz.

D asks one node to lead: it corrects itself and listens to nobody, so the network is never faster than that node alone.
In a mutual network (ours) every node corrects itself, E_i = T_x - Lt_i C_i, and listens: (8) holds for each, the errors
obey the same equation with chi everywhere, and its spectral radius is the proof.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monitor.acceptor import unobservable
from monitor.kernel import null_space
from monitor.riccati import dual_lqr

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from monitor.distributed.network import Network
    from monitor.distributed.solution import NodeSolution

_LEVEL = 1e-9  # relative: radii that differ by less are equal
_SMALLEST, _LARGEST, _TRIED = 1e-4, 1.0, 30  # couplings tried for a sampled network, times 1 / largest degree


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeGains:
    """Matrices of one node, D (6).

    Attributes:
        E: (n, n).
        F: (n, m).
        L: (n, p).
        H: (n, p).
        C: (p, n) output map, for residual and start.
        chi: coupling, 0 for the leader.
        start: (n,) where the estimate starts before the first output corrects it.
    """

    E: NDArray[np.float64]
    F: NDArray[np.float64]
    L: NDArray[np.float64]
    H: NDArray[np.float64]
    C: NDArray[np.float64]
    chi: float
    start: NDArray[np.float64]


def leader_gain(solution: NodeSolution, *, sampled: bool) -> NDArray[np.float64] | None:
    """Lt from the Riccati equation with weights I, I: T_x - Lt C is Hurwitz (Schur when sampled); None: not found.

    Directions that C and C T_x show by less than their noise are left out: a gain there would amplify that noise.
    """
    from scipy.linalg import solve_continuous_are  # noqa: PLC0415 (slow to import)

    hidden = unobservable(solution.T_x, solution.C, solution.tolerance)
    seen = np.eye(len(solution.T_x)) if not hidden.size else null_space(hidden.T)
    A, C = seen.T @ solution.T_x @ seen, solution.C @ seen
    if not len(A):
        return np.zeros_like(solution.T_y)
    if sampled:
        gain = dual_lqr(A, C)
        return None if gain is None else np.asarray(seen @ gain)
    try:
        gain = solve_continuous_are(A.T, C.T, np.eye(len(A)), np.eye(len(C))) @ C.T
    except (np.linalg.LinAlgError, ValueError):
        return None
    return np.asarray(seen @ gain, dtype=np.float64)


def leading(
    solutions: Sequence[NodeSolution], leader: int | None, may_lead: Sequence[int], *, sampled: bool
) -> list[NDArray[np.float64]] | None:
    """Lt of every node: the leader's alone in D, and that of each node that may lead in a mutual network.

    None when no gain is found for the leader; in a mutual network such a node only listens.
    """
    chosen = may_lead if leader is None else (leader,)
    found = [leader_gain(one, sampled=sampled) if node in chosen else None for node, one in enumerate(solutions)]
    if leader is not None and found[leader] is None:
        return None
    return [np.zeros_like(one.T_y) if gain is None else gain for gain, one in zip(found, solutions, strict=True)]


def assemble(
    solutions: Sequence[NodeSolution], leader: int | None, corrections: Sequence[NDArray[np.float64]], chi: float
) -> list[NodeGains]:
    """D (21) for all nodes, with Lt of each; the leader, if there is one, listens to nobody."""
    gains = []
    for node, (solution, correction) in enumerate(zip(solutions, corrections, strict=True)):
        E = solution.T_x - correction @ solution.C
        gains.append(
            NodeGains(
                E=E,
                F=solution.T_u,
                L=correction + E @ solution.T_y,
                H=solution.T_y,
                C=solution.C,
                chi=0.0 if node == leader else chi,
                start=solution.start,
            )
        )
    return gains


def error_dynamics(gains: Sequence[NodeGains], network: Network) -> NDArray[np.float64]:
    """(N n, N n) matrix of the errors of all nodes."""
    from scipy.linalg import block_diag  # noqa: PLC0415 (slow to import)

    coupling = np.diag([one.chi for one in gains]) @ network.laplacian
    return np.asarray(block_diag(*[one.E for one in gains]) - np.kron(coupling, np.eye(len(gains[0].E))))


def stability(matrix: NDArray[np.float64], *, sampled: bool) -> float:
    """Spectral radius of a sampled network, spectral abscissa of a continuous one."""
    eigenvalues = np.linalg.eigvals(matrix)
    return float(np.max(np.abs(eigenvalues) if sampled else eigenvalues.real))


def coupling_bound(solutions: Sequence[NodeSolution], network: Network, leader: int) -> float:
    """D (13): a coupling above max lambda_max((E_i + E_i') / 2) / lambda_min(Lap_1) stabilises a continuous network."""
    slowest = [
        float(np.linalg.eigvalsh((one.T_x + one.T_x.T) / 2.0)[-1])
        for node, one in enumerate(solutions)
        if node != leader
    ]
    return max(slowest, default=0.0) / network.grounded(leader)


def best_coupling(
    solutions: Sequence[NodeSolution],
    network: Network,
    leader: int | None,
    corrections: Sequence[NDArray[np.float64]],
) -> float:
    """Coupling of the smallest spectral radius of a sampled network, by search: (13) has no counterpart there.

    A sampled network overshoots when chi times the degree comes near 1, so couplings are tried on a logarithmic grid
    below 1 / largest degree.
    """
    degree = float(np.max(np.diag(network.laplacian)))
    tried = np.geomspace(_SMALLEST, _LARGEST, _TRIED) / degree
    radii = [
        stability(error_dynamics(assemble(solutions, leader, corrections, float(chi)), network), sampled=True)
        for chi in tried
    ]
    # where the leader alone decides, many are level to rounding: the smallest of them, on every machine
    return float(tried[int(np.flatnonzero(np.array(radii) <= min(radii) * (1.0 + _LEVEL))[0])])


def lie_response(
    gains: Sequence[NodeGains], network: Network, liar: int, bias: NDArray[np.float64], *, sampled: bool
) -> NDArray[np.float64]:
    """Steady errors (N, n) of all nodes when one adds a constant bias (n,) to the estimates that it sends.

    Every hearer is pulled by chi a_i,liar bias; the network being stable, the errors stay bounded.
    """
    matrix = error_dynamics(gains, network)
    pull = np.concatenate([one.chi * network.adjacency[node, liar] * bias for node, one in enumerate(gains)])
    rest = np.eye(len(matrix)) - matrix if sampled else -matrix
    return np.asarray(np.linalg.solve(rest, pull).reshape(len(gains), -1))
