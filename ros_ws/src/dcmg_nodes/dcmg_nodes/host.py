"""What the nodes of one process share."""

from __future__ import annotations

from dataclasses import dataclass

from dcmg_nodes.lifetime import Lifetime
from dcmg_nodes.local_bus import LocalBus


@dataclass(frozen=True, slots=True, kw_only=True)
class Host:
    """One process of a run.

    Attributes:
        lifetime: how long it lives.
        bus: delivery between its own nodes.
    """

    lifetime: Lifetime
    bus: LocalBus


def host_of(nodes: tuple[str, ...]) -> Host:
    """Return the host of a process that holds these nodes."""
    return Host(lifetime=Lifetime(nodes), bus=LocalBus(nodes))
