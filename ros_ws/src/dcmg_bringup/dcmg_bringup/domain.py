"""Free ROS domain ids: runs side by side on one machine must not see each other.

A domain is taken by holding an exclusive lock on its file in a folder of the user's own. The file says which run holds
it, and the lock vanishes with the process, however it dies: so the files are also the list of running systems. What
other users run is seen by its UDP ports. The nodes of a run have a second domain, for themselves alone.
"""

from __future__ import annotations

import fcntl
import json
import os
import socket
import stat
import tempfile
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dcmg.errors import CommandError

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

# Above 101 the UDP ports of a domain run into Linux's ephemeral range; 0 is everybody's default.
DOMAINS = range(1, 102)
_PRIVATE = 0o700
REPLAY = "replay of "  # how the name of a system begins that plays a bag
LAST_DOMAIN = 232  # beyond it there are no UDP ports left
_INNER_DOMAINS = range(LAST_DOMAIN, 214, -1)  # above the ephemeral ports, where people do not look
_VARIABLE = "ROS_DOMAIN_ID"
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


def domain_of_environment() -> int | None:
    """Return the domain that ROS_DOMAIN_ID names, None where it is not set or empty.

    Raises:
        DomainError: it names none.
    """
    text = os.environ.get(_VARIABLE, "").strip()
    if not text:
        os.environ.pop(_VARIABLE, None)  # rclpy takes an empty one for an error
        return None
    if not (text.isdecimal() and int(text) <= LAST_DOMAIN):
        raise DomainError(f"{_VARIABLE}={text}: expected a ROS domain id from 0 to {LAST_DOMAIN}")
    return int(text)


def checked_domain(domain: int | None) -> int | None:
    """Return the domain of an option --domain, else that of the environment, None without either.

    Raises:
        DomainError: there is no such domain.
    """
    if domain is None:
        return domain_of_environment()
    if not 0 <= domain <= LAST_DOMAIN:
        raise DomainError(f"--domain {domain}: expected a ROS domain id from 0 to {LAST_DOMAIN}")
    return domain


@contextmanager
def inner_domain(public: int, elsewhere: Collection[int] = ()) -> Iterator[int]:
    """Hold a ROS domain id for the nodes of one run alone, for the time of the `with` block.

    It is held by a socket that the kernel knows by its name alone: every user and every run of this machine sees it.

    Args:
        public: where outsiders join the run; not this one.
        elsewhere: those that are taken on other hosts of the run.

    Raises:
        DomainError: none is free.
    """
    for domain in (*_INNER_DOMAINS, *reversed(DOMAINS)):
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as holder:
            if domain != public and domain not in elsewhere and _try_hold(holder, domain) and _ports_are_free(domain):
                yield domain
                return
    raise DomainError("no ROS domain id is free for the nodes of another run on this machine: wait for one to end")


@contextmanager
def hold_inner_domain(domain: int) -> Iterator[None]:
    """Hold this ROS domain id for the nodes that a run of another host has here, for the time of the `with` block.

    Raises:
        DomainError: it is taken.
    """
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as holder:
        if not _try_hold(holder, domain):
            raise DomainError(f"ROS domain id {domain} is taken by another run on that machine: start again")
        yield


def taken_inner_domains() -> list[int]:
    """Return the ROS domain ids that runs on this machine, or other programs, have for their nodes."""
    return [domain for domain in _INNER_DOMAINS if _is_inner(domain) or not _ports_are_free(domain)]


def _try_hold(holder: socket.socket, domain: int) -> bool:
    try:
        holder.bind(f"\0dcmg-nodes-of-a-run-{domain}")
    except OSError:
        return False
    return True


def _is_inner(domain: int) -> bool:
    """Whether the nodes of a run have a domain for themselves."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as holder:
        return not _try_hold(holder, domain)


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
        handle = _open_lock(domain)
        try:
            if not _try_lock(handle) or _is_inner(domain) or (wanted is None and not _ports_are_free(domain)):
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
    for domain in range(LAST_DOMAIN + 1):
        if not os.path.lexists(_lock_path(domain)):
            continue
        handle = _open_lock(domain)
        try:
            if not _try_lock(handle):
                found.append(_system_of(os.pread(handle, 65536, 0), domain))
        finally:
            os.close(handle)
    return found


def _system_of(text: bytes, domain: int) -> RunningSystem:
    """What a locked file says; one that says nothing sensible is a run all the same."""
    try:
        said = json.loads(text)
        return RunningSystem(domain=domain, pid=int(said["pid"]), scenario=str(said["scenario"]), out=str(said["out"]))
    except (ValueError, TypeError, KeyError, RecursionError):
        return RunningSystem(domain=domain, pid=0, scenario="unknown", out="")


def _lock_path(domain: int) -> Path:
    return _folder() / f"domain_{domain}.json"


def _open_lock(domain: int) -> int:
    path = _lock_path(domain)
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
    except OSError as error:
        raise DomainError(f"{path}: expected a file of our own to lock: {error.strerror}") from error


def _folder() -> Path:
    """The user's own folder for locks; nobody else can have put anything there.

    Raises:
        DomainError: it is not ours alone.
    """
    runtime = os.environ.get("XDG_RUNTIME_DIR", "")
    trusted = Path(runtime) / "dcmg" if Path(runtime).is_absolute() and Path(runtime).is_dir() else None
    for folder in (trusted, Path(tempfile.gettempdir()) / f"dcmg-{os.getuid()}"):
        if folder is None:
            continue
        try:
            folder.mkdir(mode=_PRIVATE, exist_ok=True)
            found = folder.lstat()
        except OSError:
            continue
        if stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & ~_PRIVATE & 0o777:
            return folder
    raise DomainError(f"{folder}: expected a folder that is yours alone (owner, mode 0700): remove it or set TMPDIR")


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
