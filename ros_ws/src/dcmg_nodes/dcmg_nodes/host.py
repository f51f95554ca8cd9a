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
        alone: whether no supervisor looks after it.
    """

    lifetime: Lifetime
    bus: LocalBus
    alone: bool = False


def host_of(nodes: tuple[str, ...], *, alone: bool = False) -> Host:
    """Return the host of a process that holds these nodes."""
    return Host(lifetime=Lifetime(nodes), bus=LocalBus(nodes), alone=alone)
