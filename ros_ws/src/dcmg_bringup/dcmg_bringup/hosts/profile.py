"""The Fast DDS profile of one host of a run: its named interface only, and the other hosts as peers, by unicast."""

from __future__ import annotations

from importlib import resources
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

LOOPBACK = "127.0.0.1"
_WHITE = f"<address>{LOOPBACK}</address>"
_PEERS = "<initialPeersList>"
_PEER = "<locator><udpv4><address>{}</address></udpv4></locator>"
# An unnamed locator of its own keeps a participant from listening to multicast: no other run on this network hears us,
# and we hear none.
_UNICAST = "<metatrafficUnicastLocatorList><locator/></metatrafficUnicastLocatorList>"


def write_profile(path: Path, shipped: str, interfaces: Sequence[str], peers: Sequence[str]) -> Path:
    """Write the profile that `shipped` (fastdds.xml, gate.xml) becomes on a host.

    Args:
        path: where to.
        shipped: name of a profile of `dcmg_nodes`, which has the loopback interface in both places.
        interfaces: addresses of this host whose interfaces are used.
        peers: addresses where participants announce themselves, this host's own included.
    """
    text = (resources.files("dcmg_nodes") / shipped).read_text()
    white, peer_list = text.split(_PEERS)
    white = white.replace(_WHITE, "".join(f"<address>{one}</address>" for one in interfaces))
    rest = peer_list.partition("</initialPeersList>")[2]
    found = "".join(_PEER.format(one) for one in peers)
    path.write_text(f"{white}{_UNICAST}{_PEERS}{found}</initialPeersList>{rest}")
    return path
