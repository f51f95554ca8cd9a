"""Machines for tests: each a network, mount, process and host name namespace, on one bridge, gone afterwards.

Nothing outside of these namespaces is touched: the bridge is in one, too, and all of them are in a user namespace.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Self

SECRET = "the secret of this laboratory"  # noqa: S105 - no secret of anybody's
_ENTERED_SEC = 5.0
_ALL = ("-U", "-n", "-m", "-p", "-u")


class LabError(Exception):
    """This machine does not allow what a laboratory needs; the message says what."""


@dataclass(slots=True)
class Machine:
    """One host: `init` is process 1 of its namespaces, and all that runs there ends with it."""

    name: str
    address: str
    init: int
    holder: subprocess.Popen[bytes]


@dataclass(slots=True)
class Lab:
    """Hosts lab1, lab2, … on a bridge, each with an interface run0 for the run and one, other0, for nothing.

    Attributes:
        folder: where each host keeps its temporary files.
        hosts: how many.
    """

    folder: Path
    hosts: int
    machines: dict[str, Machine] = field(default_factory=dict)
    _lan: Machine | None = None

    def __enter__(self) -> Self:
        """Make the hosts.

        Raises:
            LabError: namespaces are not allowed here, or a tool is missing.
        """
        try:
            self._lan = _machine("lan", "", ["unshare", "-Urn", "--kill-child", "--fork", "cat"])
            for bridge in ("run", "other"):
                self._in_lan("ip", "link", "add", bridge, "type", "bridge")
                self._in_lan("ip", "link", "set", bridge, "up")
            for number in range(1, self.hosts + 1):
                self._add(number)
        except (OSError, subprocess.SubprocessError) as error:
            self.__exit__()
            said = getattr(error, "stderr", "") or str(error)
            raise LabError(said.strip().splitlines()[-1]) from error
        return self

    def __exit__(self, *_: object) -> None:
        """End everything."""
        for name in list(self.machines):
            self.kill(name)
        if self._lan is not None:
            _end(self._lan)

    def start(self, name: str, *command: str, **environment: str) -> subprocess.Popen[str]:
        """Run a command on a host."""
        return subprocess.Popen(
            [*self._inside(name), *command],
            env={**os.environ, "TMPDIR": str(self.folder / name), "DCMG_HOST_SECRET": SECRET, **environment},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def processes(self, name: str) -> list[str]:
        """Titles of all that runs on a host."""
        listed = subprocess.run([*self._inside(name), "ps", "-eo", "args="], capture_output=True, text=True, check=True)
        return listed.stdout.splitlines()

    def cut(self, name: str) -> None:
        """Pull the cable of a host."""
        self._in_lan("ip", "link", "set", f"run{self.machines[name].address.rpartition('.')[2]}", "down")

    def mend(self, name: str) -> None:
        """Plug it in again."""
        self._in_lan("ip", "link", "set", f"run{self.machines[name].address.rpartition('.')[2]}", "up")

    def kill(self, name: str) -> None:
        """Switch a host off."""
        _end(self.machines.pop(name))

    def packets(self, name: str, interface: str) -> int:
        """Count what a host has sent on an interface."""
        command = [*self._inside(name), "ip", "-s", "-j", "link", "show", interface]
        said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        found: Mapping[str, Mapping[str, Mapping[str, int]]] = json.loads(said)[0]
        return found["stats64"]["tx"]["packets"]

    def _add(self, number: int) -> None:
        name, address = f"lab{number}", f"10.9.0.{number}"
        (self.folder / name).mkdir()
        assert self._lan is not None
        fork = ["unshare", "-nmpu", "--fork", "--kill-child", "--mount-proc", "cat"]
        self.machines[name] = machine = _machine(
            name, address, ["nsenter", f"-t{self._lan.init}", "-U", "--preserve-credentials", *fork]
        )
        for kind in ("run", "other"):
            veth = f"{kind}{number}"
            peer = ("peer", "name", f"{kind}0", "netns", str(machine.init))
            self._in_lan("ip", "link", "add", veth, "type", "veth", *peer)
            self._in_lan("ip", "link", "set", veth, "master", kind, "up")
        for line in (
            "mount -t tmpfs none /dev/shm",
            f"hostname {name}",
            "echo 1 > /proc/sys/net/ipv6/conf/all/disable_ipv6",
            "ip link set lo up",
            f"ip addr add {address}/24 dev run0",
            "ip link set run0 up",
            f"ip addr add 10.8.0.{number}/24 dev other0",
            "ip link set other0 up",
            "ip route add default via 10.8.0.254",  # where multicast and whatever is not for run0 would go
        ):
            _checked([*self._inside(name), "sh", "-c", line])

    def _inside(self, name: str) -> Sequence[str]:
        return ["nsenter", f"-t{self.machines[name].init}", *_ALL, "--preserve-credentials"]

    def _in_lan(self, *command: str) -> None:
        assert self._lan is not None
        _checked(["nsenter", f"-t{self._lan.init}", "-U", "-n", "--preserve-credentials", *command])


def _machine(name: str, address: str, command: Sequence[str]) -> Machine:
    """Start what makes the namespaces and holds them, and wait for its first process."""
    holder = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE)
    deadline = time.monotonic() + _ENTERED_SEC
    while time.monotonic() < deadline and holder.poll() is None:
        inner = Path(f"/proc/{holder.pid}/task/{holder.pid}/children").read_text().split()
        with suppress(OSError):
            if inner and Path(f"/proc/{inner[0]}/exe").readlink().name == "cat":
                return Machine(name, address, int(inner[0]), holder)
        time.sleep(0.01)
    holder.kill()
    _, said = holder.communicate()
    raise subprocess.CalledProcessError(1, command, stderr=said.decode() or "no namespace")


def _end(machine: Machine) -> None:
    with suppress(ProcessLookupError):
        os.kill(machine.init, signal.SIGKILL)
    machine.holder.communicate(timeout=10.0)


def _checked(command: Sequence[str]) -> None:
    subprocess.run(command, check=True, capture_output=True, text=True)


DCMG = (sys.executable, "-m", "dcmg")
