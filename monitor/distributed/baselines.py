"""Baselines, labelled as what they are; nothing data-driven may import them.

`model_based` is Theorem 1 of D with known A, B_i, Bbar_i, C_i. `identification_based` is the ID-DUIO that D compares
with: Bbar_i and C_i are known, A and B_i are identified by least squares from the same data as if there were no unknown
inputs, and Theorem 1 is applied to them. D does not say whether every node identifies a model of its own or all have
one: `identification_based` does the former, `jointly_identified` the latter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monitor.distributed.designing import DistributedOptions, design_network, disconnected, refused
from monitor.distributed.report import DistributedDesign, DistributedReport
from monitor.distributed.solution import NodeSolution
from monitor.options import parse_options

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from monitor.distributed.network import Network
    from monitor.distributed.regressors import Regressors

_RANK = 1e-9  # relative: singular values below it are zero


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeModel:
    """The plant from one node's perspective, D (5) and (2): x' = A x + B u_i + Bbar d_i, y = C x.

    Attributes:
        A: (n, n).
        B: (n, m) of the inputs the node knows.
        Bbar: (n, q) of those it does not; columns that act alike are merged.
        C: (p, n).
    """

    A: NDArray[np.float64]
    B: NDArray[np.float64]
    Bbar: NDArray[np.float64]
    C: NDArray[np.float64]


def model_based(
    models: Sequence[NodeModel], network: Network, options: Mapping[str, object], *, sampled: bool
) -> DistributedDesign:
    """Design the network by Theorem 1 of D; a refusal is a value.

    Raises:
        MonitorError: an option that does not fit.
    """
    chosen = parse_options(DistributedOptions, options, "model-based distributed UIO")
    report = DistributedReport(sampled=sampled, nodes=network.nodes, states=len(models[0].A))
    if reason := disconnected(network):
        return refused(reason, report, network)
    solutions = []
    for node, model in enumerate(models):
        found = solution_of(model)
        if isinstance(found, str):
            return refused(f"node {node + 1}: {found}", report, network)
        solutions.append(found)
    return design_network(solutions, network, chosen, report)


def identification_based(
    data: Sequence[Regressors],
    couplings: Sequence[NodeModel],
    network: Network,
    options: Mapping[str, object],
) -> DistributedDesign:
    """Identify [A B_i] = Xdot [X; U]^+ from every node's data, then Theorem 1; Bbar and C are taken from `couplings`.

    Raises:
        MonitorError: an option that does not fit.
    """
    models = []
    for one, coupling in zip(data, couplings, strict=True):
        coefficients = one.Xdot @ np.linalg.pinv(np.vstack([one.X, one.U]))
        A, B = np.split(coefficients, [len(one.X)], axis=1)
        models.append(NodeModel(A=A, B=B, Bbar=coupling.Bbar, C=coupling.C))
    return model_based(models, network, options, sampled=data[0].sampled)


def jointly_identified(
    data: Sequence[Regressors],
    couplings: Sequence[NodeModel],
    inputs: Sequence[Sequence[int]],
    network: Network,
    options: Mapping[str, object],
) -> DistributedDesign:
    """Identify one A and B from the data of all nodes, each with the inputs it knows, then Theorem 1.

    What a node does not know acts as an error along its Bbar_i. Least squares take part of it for A + sum_i Bbar_i K_i,
    and node j removes no more than Bbar_j K_j: the others' part stays.

    Args:
        data: of every node.
        couplings: Bbar and C of every node.
        inputs: numbers of the plant's inputs that each node knows, in the order of its U.
        network: who exchanges estimates with whom.
        options: as for the others.

    Raises:
        MonitorError: an option that does not fit.
    """
    n, m = len(data[0].X), 1 + max((one for known in inputs for one in known), default=-1)
    regressors = []
    for one, known in zip(data, inputs, strict=True):
        U = np.zeros((m, one.columns))
        U[list(known)] = one.U
        regressors.append(np.vstack([one.X, U]))
    coefficients = np.hstack([one.Xdot for one in data]) @ np.linalg.pinv(np.hstack(regressors))
    A, B = np.split(coefficients, [n], axis=1)
    models = [
        NodeModel(A=A, B=B[:, list(known)], Bbar=coupling.Bbar, C=coupling.C)
        for known, coupling in zip(inputs, couplings, strict=True)
    ]
    return model_based(models, network, options, sampled=data[0].sampled)


def solution_of(model: NodeModel) -> NodeSolution | str:
    """H = Bbar (C Bbar)^+, D (11) with Y = 0, and the T matrices; or the condition of Lemma 1 that fails."""
    Bbar = _merged(model.Bbar)
    r = Bbar.shape[1]
    C_Bbar = model.C @ Bbar
    values = np.linalg.svd(C_Bbar, compute_uv=False)
    shown = int(np.count_nonzero(values > _RANK * np.max(values, initial=_RANK)))
    if shown < r:
        return f"rank C Bbar is {shown}, expected rank Bbar = {r} (Lemma 1 of D)"
    H = Bbar @ np.linalg.pinv(C_Bbar)
    remaining = np.eye(len(model.A)) - H @ model.C
    return NodeSolution(
        T_x=remaining @ model.A,
        T_u=remaining @ model.B,
        T_y=np.asarray(H),
        C=model.C,
        unknown_inputs=r,
        start=np.zeros(len(model.A)),
        misfit=0.0,
    )


def _merged(Bbar: NDArray[np.float64]) -> NDArray[np.float64]:
    """Columns of full column rank with the same range."""
    left, values, _ = np.linalg.svd(Bbar, full_matrices=False)
    rank = int(np.count_nonzero(values > _RANK * np.max(values, initial=_RANK)))
    return np.asarray(left[:, :rank] * values[:rank])
