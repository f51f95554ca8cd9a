"""The distributed data-driven UIO (D): from the data of every node to the observers of all."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass as checked_dataclass

from monitor.backstop import guarded
from monitor.distributed.gains import (
    NodeGains,
    assemble,
    best_coupling,
    coupling_bound,
    error_dynamics,
    leading,
    stability,
)
from monitor.distributed.node import NodeObserver
from monitor.distributed.proving import held_back, prove_node, scales_of
from monitor.distributed.report import DistributedDesign, DistributedReport
from monitor.distributed.solution import NodeSolution, shows_rounding_only, solve_node, undetectable
from monitor.errors import MonitorError
from monitor.options import STRICT, parse_options

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from monitor.distributed.network import Network
    from monitor.distributed.proving import Scales
    from monitor.distributed.regressors import Regressors
    from monitor.proof import Proof

KIND = "distributed"


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class DistributedOptions:
    """Options of the distributed design.

    Attributes:
        unknown_inputs: r of every node, when known; needed for noisy data without a clear gap.
        structure: "leader" as in D, or "mutual" (sampled data only): every node corrects itself and listens.
        leader: number of the leading node, from 0; the first that may lead unless given; none in a mutual network.
        chi: coupling; 1.1 times D (13) in continuous time and the best of a search when sampled, unless given.
    """

    unknown_inputs: tuple[int, ...] | None = None
    structure: Literal["leader", "mutual"] = "leader"
    leader: int | None = Field(default=None, ge=0)
    chi: float | None = Field(default=None, gt=0.0)


_MARGIN = 1.1  # times the bound (13)
_ROUNDING = 1e-9  # relative: a radius this near 1, or an abscissa this near 0, is no decay


def design(data: Sequence[Regressors], network: Network, options: Mapping[str, object]) -> DistributedDesign:
    """Design the network from data alone, D Theorem 4; a refusal is a value that names the violated condition.

    Args:
        data: of every node, in the order of the network; all in one form.
        network: who exchanges estimates with whom.
        options: see DistributedOptions.

    Raises:
        MonitorError: numbers of nodes, states or forms that do not fit together, or an option that does not fit.
    """
    chosen = parse_options(DistributedOptions, options, KIND)
    _check(data, network, chosen)
    report = DistributedReport(sampled=data[0].sampled, nodes=network.nodes, states=len(data[0].X))
    if reason := disconnected(network):
        return refused(reason, report, network)
    return guarded(lambda: _design(data, network, chosen, report), lambda reason: refused(reason, report, network))


def _design(
    data: Sequence[Regressors], network: Network, chosen: DistributedOptions, report: DistributedReport
) -> DistributedDesign:
    parts = [held_back(one) for one in data]
    scales = scales_of([seen for seen, _ in parts])
    exact = [one for one, _ in parts if shows_rounding_only(one)]
    solutions: list[NodeSolution] = []
    proofs: list[Proof] = []
    for node, (one, own) in enumerate(zip(parts, scales, strict=True)):
        known = None if chosen.unknown_inputs is None else chosen.unknown_inputs[node]
        seen, unseen = (each.in_units(own.u, own.y, own.x) for each in one)
        certain = any(_same_record(one[0], other) for other in exact)
        found = solve_node(seen, known, exact=certain)
        if isinstance(found, str):
            return refused(f"node {node + 1}: {found}", report, network)
        proofs.append(prove_node(found, seen, unseen))
        if not proofs[-1].holds:
            return refused(f"node {node + 1}: {proofs[-1].refusal()}", replace(report, **_figures(proofs)), network)
        solutions.append(found)
    made = design_network(solutions, network, chosen, replace(report, **_figures(proofs)))
    for node, (gains, found) in enumerate(zip(made.gains, solutions, strict=False)):
        seen, unseen = (each.in_units(scales[node].u, scales[node].y, scales[node].x) for each in parts[node])
        proofs[node] = prove_node(found, seen, unseen, gains.L - gains.E @ gains.H)
        if not proofs[node].holds:
            reason = f"node {node + 1}, with its correction: {proofs[node].refusal()}"
            return refused(reason, replace(report, **_figures(proofs)), network)
    return _in_units(replace(made, report=replace(made.report, **_figures(proofs))), scales, proofs)


def _same_record(one: Regressors, other: Regressors) -> bool:
    return np.array_equal(one.X, other.X) and np.array_equal(one.Xdot, other.Xdot)


def _figures(proofs: Sequence[Proof]) -> dict[str, Any]:
    """What the report says of unseen columns."""
    return {
        "unseen": tuple(one.samples for one in proofs),
        "unseen_error": tuple(max(one.worst_error or 0.0, one.worst_residual or 0.0) for one in proofs),
        "spare_columns": tuple(one.spare_columns for one in proofs),
    }


def _in_units(made: DistributedDesign, scales: Sequence[Scales], proofs: Sequence[Proof]) -> DistributedDesign:
    """An accepted design in the user's units, with its figures."""
    if not made.accepted:
        return made
    gains = tuple(own.gains(one) for own, one in zip(scales, made.gains, strict=True))
    worst, samples = max(made.report.unseen_error), min(one.samples for one in proofs)
    running = made.observers and tuple(observer_of(gains, made.network, node) for node in range(len(gains)))
    verdict = f"{made.verdict}; on {samples} unseen columns or more: every node within {worst:.1g}"
    return replace(made, gains=gains, observers=running, verdict=verdict)


def design_network(
    solutions: Sequence[NodeSolution], network: Network, options: DistributedOptions, report: DistributedReport
) -> DistributedDesign:
    """Pick the leader and the coupling and prove that the errors of the whole network converge."""
    failing = [undetectable(one, sampled=report.sampled) for one in solutions]
    may_lead = tuple(node for node, modes in enumerate(failing) if not len(modes))
    report = replace(
        report,
        may_lead=may_lead,
        unknown_inputs=tuple(one.unknown_inputs for one in solutions),
        misfit=tuple(one.misfit for one in solutions),
    )
    leader = _leader(options, may_lead)
    if options.structure == "leader" and leader not in may_lead:
        node = 0 if leader is None else leader
        who = "no node can lead" if leader is None else f"node {node + 1} cannot lead"
        modes = ", ".join(f"{mode:.4g}" for mode in failing[node])
        doubt = "" if solutions[node].exact else "; borderline: what noise alone shows is not seen"
        return refused(
            f"{who}: condition (19) of D fails, for node {node + 1} at s = {modes} (undetectable{doubt})",
            report,
            network,
        )
    corrections = leading(solutions, leader, may_lead, sampled=report.sampled)
    if corrections is None:
        return refused("no leader gain is found: modes are all but undetectable at the leader", report, network)
    bound = None if report.sampled or leader is None else coupling_bound(solutions, network, leader)
    chi = options.chi or _coupling(solutions, network, leader, corrections, bound)
    gains = tuple(assemble(solutions, leader, corrections, chi))
    dynamics = error_dynamics(gains, network)
    reached = stability(dynamics, sampled=report.sampled)
    report = replace(report, leader=leader, chi=chi, chi_bound=bound, stability=reached)
    if reached >= (1.0 - _ROUNDING if report.sampled else -_ROUNDING * float(np.linalg.norm(dynamics, 2))):
        limit = "spectral radius" if report.sampled else "spectral abscissa"
        hint = "" if bound is None else f", D (13) asks for chi > {bound:.4g}"
        return refused(f"chi = {chi:.4g} leaves the {limit} of the errors at {reached:.4g}{hint}", report, network)
    report = replace(
        report,
        convergence=float(np.log(0.01) / (np.log(max(reached, 1e-300)) if report.sampled else reached)),
        departures=tuple(departure(gains, network, node, sampled=report.sampled) for node in range(network.nodes)),
    )
    return DistributedDesign(
        accepted=True,
        verdict=_verdict(report),
        report=report,
        network=network,
        gains=gains,
        observers=tuple(observer_of(gains, network, node) for node in range(network.nodes)) if report.sampled else (),
    )


def departure(gains: Sequence[NodeGains], network: Network, node: int, *, sampled: bool) -> float:
    """Stability of the errors of the others when one node is silent; -inf or 0 when nobody is left."""
    rest = [one for one in range(network.nodes) if one != node]
    matrix = error_dynamics(gains, network.without((node,)))
    n = len(gains[0].E)
    kept = [one * n + row for one in rest for row in range(n)]
    if not kept:
        return 0.0 if sampled else -np.inf
    return stability(matrix[np.ix_(kept, kept)], sampled=sampled)


def observer_of(gains: Sequence[NodeGains], network: Network, node: int) -> NodeObserver:
    """The running part of one node of a sampled network."""
    neighbours = network.neighbours(node)
    weights = tuple(float(network.adjacency[node, other]) for other in neighbours)
    return NodeObserver.of(gains[node], neighbours, weights)


def disconnected(network: Network) -> str | None:
    """Why assumption 1 of D fails, if it does."""
    lost = network.unreachable()
    if not lost:
        return None
    listed = ", ".join(str(node + 1) for node in lost)
    return f"assumption 1 of D fails: the graph is not connected, no path from node 1 to {listed}"


def refused(reason: str, report: DistributedReport, network: Network) -> DistributedDesign:
    """A design that did not come about, with the reason in one line."""
    return DistributedDesign(accepted=False, verdict=f"refused: {reason}", report=report, network=network)


def _leader(options: DistributedOptions, may_lead: Sequence[int]) -> int | None:
    """The node asked to lead, or the first that may; None in a mutual network or when nobody may."""
    if options.structure == "mutual":
        return None
    if options.leader is not None:
        return options.leader
    return may_lead[0] if may_lead else None


def _coupling(
    solutions: Sequence[NodeSolution],
    network: Network,
    leader: int | None,
    corrections: Sequence[NDArray[np.float64]],
    bound: float | None,
) -> float:
    """Coupling when none is asked for."""
    if bound is None:
        return best_coupling(solutions, network, leader, corrections)
    rounding = _ROUNDING * max(float(np.linalg.norm(one.T_x, 2)) for one in solutions)
    return _MARGIN * bound if bound > rounding else 1.0  # (13) allows any positive coupling then


def _check(data: Sequence[Regressors], network: Network, options: DistributedOptions) -> None:
    if len(data) != network.nodes:
        raise MonitorError(f"data of {len(data)} nodes, expected {network.nodes} as in the network")
    if len({len(one.X) for one in data}) != 1 or len({one.sampled for one in data}) != 1:
        raise MonitorError("nodes differ in the number of states or in the form of their data, expected the same")
    if options.unknown_inputs is not None and len(options.unknown_inputs) != len(data):
        raise MonitorError(f"{len(options.unknown_inputs)} numbers of unknown inputs for {len(data)} nodes")
    if options.structure == "mutual" and (options.leader is not None or not data[0].sampled):
        raise MonitorError(f"{KIND}: a mutual network has no leader and is for sampled data")
    if options.leader is not None and options.leader >= network.nodes:
        raise MonitorError(f"leader is {options.leader}, expected 0 to {network.nodes - 1}")


def _verdict(report: DistributedReport) -> str:
    unit = "steps" if report.sampled else "time units"
    kind = "radius" if report.sampled else "abscissa"
    led = "that all listen" if report.leader is None else f"led by node {report.leader + 1}"
    return (
        f"accepted: {report.nodes} nodes {led}, chi = {report.chi:.4g}; errors of the "
        f"whole network shrink to 1 % in {report.convergence:.3g} {unit} ({kind} {report.stability:.4g})"
    )
