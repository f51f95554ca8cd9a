"""What a distributed design knows about itself, and the design as a value."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from monitor.distributed.gains import NodeGains
    from monitor.distributed.network import Network
    from monitor.distributed.node import NodeObserver


@dataclass(frozen=True, slots=True, kw_only=True)
class DistributedReport:
    """Why the network of observers converges; parts that were never reached are None.

    Attributes:
        sampled: the design is for the sampled plant (spectral radius), else for the continuous one (abscissa).
        nodes: N.
        states: n.
        leader: number of the leading node, from 0; None in a mutual network.
        may_lead: nodes for which (19) holds.
        unknown_inputs: r of every node.
        misfit: of (20) on every node's data.
        chi: coupling.
        chi_bound: D (13), None when sampled.
        stability: spectral radius (sampled) or abscissa of the errors of the whole network.
        convergence: steps (sampled) or time units in which the slowest error shrinks to 1 %.
        departures: stability of the rest when one node leaves, for every node; the network keeps its gains.
        unseen: columns of every node that its solution was held against without having seen them.
        unseen_error: largest error of every node there, in shares of the spread.
        spare_columns: columns of every node beyond the directions that they span.
    """

    sampled: bool
    nodes: int
    states: int
    leader: int | None = None
    may_lead: tuple[int, ...] = ()
    unknown_inputs: tuple[int, ...] = ()
    misfit: tuple[float, ...] = ()
    chi: float | None = None
    chi_bound: float | None = None
    stability: float | None = None
    convergence: float | None = None
    departures: tuple[float, ...] = ()
    unseen: tuple[int, ...] = ()
    unseen_error: tuple[float, ...] = ()
    spare_columns: tuple[int, ...] = ()

    def to_json(self) -> str:
        """One JSON document."""
        return json.dumps(asdict(self))


@dataclass(frozen=True, slots=True, kw_only=True)
class DistributedDesign:
    """The observers of all nodes, or the condition that fails.

    Attributes:
        accepted: whether there is a converging network.
        verdict: one line in plain words.
        report: what was found.
        network: who talks to whom.
        gains: of every node, empty when refused.
        observers: running nodes of a sampled design, empty when refused or continuous.
    """

    accepted: bool
    verdict: str
    report: DistributedReport
    network: Network
    gains: tuple[NodeGains, ...] = ()
    observers: tuple[NodeObserver, ...] = ()
