"""Free ROS domain ids: runs side by side on one machine must not see each other.

A domain is taken by holding an exclusive lock on its file in the temporary directory. The file says which run holds
it, and the lock vanishes with the process, however it dies: so the files are also the list of running systems.
"""

from __future__ import annotations

import fcntl
import json
import os
import socket
import tempfile
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dcmg.errors import CommandError

if TYPE_CHECKING:
    from collections.abc import Iterator

# Above 101 the UDP ports of a domain run into Linux's ephemeral range; 0 is everybody's default.
DOMAINS = range(1, 102)
_PORT_BASE, _PORTS_PER_DOMAIN, _FIRST_UNICAST, _CHECKED_PORTS = 7400, 250, 10, 4


class DomainError(CommandError):
    """No ROS domain is free, or the one asked for is taken."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunningSystem:
    """A run on this machine: its ROS domain id, process id, scenario name and output directory."""

    domain: int
    pid: int
    scenario: str
    out: str


@contextmanager
def choose_domain(wanted: int | None = None, *, scenario: str = "", out: str = "") -> Iterator[int]:
    """Hold a free ROS domain id for the time of the `with` block.

    Args:
        wanted: this domain and no other; None: the first free one.
        scenario: name of the scenario, told to whoever lists the running systems.
        out: output directory, likewise.

    Raises:
        DomainError: the wanted domain, or every domain, is taken.
    """
    for domain in DOMAINS if wanted is None else (wanted,):
        handle = os.open(_lock_path(domain), os.O_RDWR | os.O_CREAT, 0o666)
        try:
            if not _try_lock(handle) or (wanted is None and not _ports_are_free(domain)):
                continue
            system = RunningSystem(domain=domain, pid=os.getpid(), scenario=scenario, out=out)
            os.ftruncate(handle, 0)
            os.pwrite(handle, json.dumps(asdict(system)).encode(), 0)
            yield domain
            os.ftruncate(handle, 0)
            return
        finally:
            os.close(handle)
    which = "every ROS domain id from 1 to 101 is" if wanted is None else f"ROS domain id {wanted} is"
    raise DomainError(f"{which} taken by another program on this machine: wait for it to end, or name a free --domain")


def running_systems() -> list[RunningSystem]:
    """List the runs on this machine, by domain id."""
    found = []
    for domain in DOMAINS:
        path = _lock_path(domain)
        if not path.exists():
            continue
        handle = os.open(path, os.O_RDWR)
        try:
            if not _try_lock(handle):
                text = os.pread(handle, 65536, 0)
                if text:
                    found.append(RunningSystem(**json.loads(text)))
        finally:
            os.close(handle)
    return found


def _lock_path(domain: int) -> Path:
    folder = Path(tempfile.gettempdir()) / "dcmg-domains"
    folder.mkdir(mode=0o777, exist_ok=True)
    return folder / f"domain_{domain}.json"


def _try_lock(handle: int) -> bool:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _ports_are_free(domain: int) -> bool:
    """Tell whether nobody, of ours or not, has a DDS participant in this domain."""
    first = _PORT_BASE + _PORTS_PER_DOMAIN * domain + _FIRST_UNICAST
    for port in range(first, first + _CHECKED_PORTS):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("", port))
            except OSError:
                return False
    return True
