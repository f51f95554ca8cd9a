"""What a host is told: which nodes, of which run, how they meet; files by the hash of their content."""

from __future__ import annotations

import re
from hashlib import sha256
from typing import TYPE_CHECKING, Annotated

from pydantic import BaseModel, ConfigDict, Field

from dcmg_bringup.hosts.errors import HostsError
from dcmg_nodes.options import PacingMode  # noqa: TC001 (pydantic reads the annotations)

if TYPE_CHECKING:
    from pathlib import Path

Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
FileName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]{0,200}$")]
Bag = dict[FileName, Digest]
_DIGEST = re.compile(r"[0-9a-f]{64}")


class HostJob(BaseModel):
    """The part of one host in a run.

    Attributes:
        run: which run it is, as its nodes tell each other.
        host: name of the host in the hosts file.
        nodes: process name → names of the nodes it holds.
        domain: ROS domain id of the nodes.
        holds_domain: whether this host sees that nobody else there takes the domain.
        address: of its interface.
        peers: addresses of all hosts.
        pacing, rate, start_timeout_sec, stall_timeout_sec: as in NodeOptions.
        scenario: digest of the scenario's text.
        history: files of the bag that `history.bag` names, None: it names none.
        designs: files of the bag with the designs that the monitors run.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    run: str
    host: str
    nodes: dict[str, tuple[str, ...]]
    domain: int
    holds_domain: bool
    address: str
    peers: tuple[str, ...]
    pacing: PacingMode
    rate: float
    start_timeout_sec: float
    stall_timeout_sec: float
    scenario: Digest
    history: Bag | None
    designs: Bag | None

    @property
    def digests(self) -> set[str]:
        """Digests of all files that the host needs."""
        bags = (self.history or {}, self.designs or {})
        return {self.scenario, *(one for bag in bags for one in bag.values())}


def digest_of(data: bytes) -> str:
    """Return the name of a content."""
    return sha256(data).hexdigest()


def files_of(bag: Path) -> dict[str, Path]:
    """Return the files of a rosbag2 directory, or the one file of a bag without one.

    Raises:
        HostsError: there is none.
    """
    found = {path.name: path for path in (sorted(bag.iterdir()) if bag.is_dir() else [bag]) if path.is_file()}
    if not found:
        raise HostsError(f"{bag}: expected a bag")
    return found


class Store:
    """Files on a host, each known by the hash of its content.

    Args:
        folder: where they are kept.
    """

    def __init__(self, folder: Path) -> None:
        """Begin with what the folder holds."""
        self._folder = folder

    def lacks(self, digests: set[str]) -> list[str]:
        """Return those that are not here."""
        return sorted(one for one in digests if not (self._folder / one).is_file())

    def add(self, digest: str, data: bytes) -> None:
        """Keep a file.

        Raises:
            HostsError: its content is another.
        """
        if digest_of(data) != digest:
            raise HostsError(f"file {digest[:12]}: came with another content")
        growing = self._folder / f"{digest}.new"
        growing.write_bytes(data)
        growing.rename(self._folder / digest)

    def read(self, digest: str) -> bytes:
        """Return the content of a file."""
        return (self._folder / digest).read_bytes()

    def lay_out(self, bag: Bag, folder: Path) -> Path:
        """Make a bag of its files."""
        folder.mkdir()
        for name, digest in bag.items():
            (folder / name).symlink_to(self._folder / digest)
        return folder
