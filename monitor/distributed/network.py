"""Who exchanges estimates with whom."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monitor.errors import MonitorError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Network:
    """Undirected weighted communication graph of D, assumption 1.

    Attributes:
        adjacency: (N, N) symmetric, non-negative, zero diagonal; a_ij > 0 where i and j exchange estimates.
    """

    adjacency: NDArray[np.float64]

    def __post_init__(self) -> None:
        """Raise MonitorError unless the graph is undirected."""
        a = self.adjacency
        if a.ndim != 2 or a.shape[0] != a.shape[1]:  # noqa: PLR2004 - a matrix
            raise MonitorError(f"adjacency has shape {a.shape}, expected as many rows as columns")
        if not np.array_equal(a, a.T) or np.any(a < 0.0) or np.any(np.diag(a) != 0.0):
            raise MonitorError(
                "adjacency is not symmetric, not non-negative or has a diagonal, expected undirected links"
            )

    @property
    def nodes(self) -> int:
        """Number N of nodes."""
        return len(self.adjacency)

    @property
    def laplacian(self) -> NDArray[np.float64]:
        """Degree matrix minus adjacency, (N, N)."""
        return np.asarray(np.diag(self.adjacency.sum(axis=1)) - self.adjacency)

    def grounded(self, leader: int) -> float:
        """lambda_min of the Laplacian without the leader's row and column (Lap_1 of D (13)); 0 when not connected."""
        others = [node for node in range(self.nodes) if node != leader]
        if not others:
            return float("inf")
        return float(np.linalg.eigvalsh(self.laplacian[np.ix_(others, others)])[0])

    def neighbours(self, node: int) -> tuple[int, ...]:
        """Nodes that exchange estimates with this one, ascending."""
        return tuple(int(other) for other in np.flatnonzero(self.adjacency[node]))

    def unreachable(self) -> tuple[int, ...]:
        """Nodes that no path connects with node 0; empty when the graph is connected."""
        reached, waiting = {0}, [0]
        while waiting:
            for other in self.neighbours(waiting.pop()):
                if other not in reached:
                    reached.add(other)
                    waiting.append(other)
        return tuple(node for node in range(self.nodes) if node not in reached)

    def without(self, nodes: Sequence[int]) -> Network:
        """Same graph with all links of some nodes cut."""
        cut = self.adjacency.copy()
        cut[list(nodes), :] = 0.0
        cut[:, list(nodes)] = 0.0
        return Network(adjacency=cut)


def ring(nodes: int) -> Network:
    """Every node exchanges with the two beside it."""
    a = np.zeros((nodes, nodes))
    for node in range(nodes):
        a[node, (node + 1) % nodes] = a[(node + 1) % nodes, node] = 1.0
    return Network(adjacency=a)


def linked(nodes: int, links: Sequence[tuple[int, int]]) -> Network:
    """Graph of unit weights from its links, nodes numbered from 0."""
    a = np.zeros((nodes, nodes))
    for first, second in links:
        a[first, second] = a[second, first] = 1.0
    return Network(adjacency=a)
