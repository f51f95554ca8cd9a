"""What a host does for one command: shows what it computes with, takes files, starts nodes, tells how they are."""

from __future__ import annotations

import os
import socket
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from bags.watch.scenarios import parse_scenario
from dcmg_bringup.domain import hold_inner_domain, taken_inner_domains
from dcmg_bringup.hosts.errors import ChannelError, HostsError
from dcmg_bringup.hosts.job import HostJob, Store
from dcmg_bringup.hosts.profile import write_profile
from dcmg_bringup.hosts.versions import versions
from dcmg_bringup.interruptions import interruptions
from dcmg_bringup.processes import ProcessGroup
from dcmg_bringup.ros_environment import ros_environment
from dcmg_nodes.options import NodeOptions

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dcmg_bringup.hosts.channel import Channel, Message

SILENT_SEC = 10.0  # without a word from the command, the run is over here
_STATUS_SEC, _POLL_SEC = 0.2, 0.05
_LOG_BYTES = 1 << 18


class Agent:
    """Serves one command, from its first word to its last.

    Args:
        channel: to the command; hands are shaken.
        store: files that earlier commands have sent.
        say: shows a line on this host.
    """

    def __init__(self, channel: Channel, store: Store, say: Callable[[str], None]) -> None:
        """Know nothing yet."""
        self._channel, self._store, self._say = channel, store, say
        self._job: HostJob | None = None
        self._growing: dict[str, bytearray] = {}

    def serve(self) -> None:
        """Do what the command asks, until it has no more wishes or is silent for too long; no process is left then."""
        hello = {"versions": versions(), "machine": machine(), "taken": taken_inner_domains()}
        with interruptions() as told, ExitStack() as stack:
            try:
                self._channel.send(hello)
                while not self._over(told):
                    message = self._channel.receive(_POLL_SEC)
                    if message is None:
                        continue
                    if "stop" in message.said:
                        return
                    if "start" in message.said and self._job is not None:
                        self._run(self._job, told, stack)
                        return
                    self._prepare(message)
            except ChannelError as error:
                self._say(f"the command {error}")
            except (HostsError, ValidationError, OSError) as error:
                self._refuse(" ".join(str(error).split()))

    def _over(self, told: Sequence[int]) -> bool:
        if told:
            self._channel.send({"refused": "was ended there"})
        return bool(told) or time.monotonic() - self._channel.heard > SILENT_SEC

    def _refuse(self, reason: str) -> None:
        self._say(f"refused: {reason}")
        try:
            self._channel.send({"refused": reason})
        except ChannelError:
            return

    def _prepare(self, message: Message) -> None:
        said = message.said
        if "ping" in said:
            self._channel.send({"pong": said["ping"], "clock_ns": time.time_ns()})
        elif "job" in said:
            self._job = HostJob.model_validate_json(said["job"])
            _check_address(self._job.address)
            self._channel.send({"lacks": self._store.lacks(self._job.digests)})
        elif "file" in said:
            digest = str(said["file"])
            self._growing.setdefault(digest, bytearray()).extend(message.payload)
            if said["last"]:
                self._store.add(digest, bytes(self._growing.pop(digest)))

    def _run(self, job: HostJob, told: Sequence[int], stack: ExitStack) -> None:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="dcmg-host-")))
        if job.holds_domain:
            stack.enter_context(hold_inner_domain(job.domain))
        profile = write_profile(folder / "fastdds.xml", "fastdds.xml", [job.address], job.peers)
        os.environ.update(ros_environment(job.domain) | {"FASTRTPS_DEFAULT_PROFILES_FILE": str(profile)})
        overrides = []
        if job.history is not None:
            overrides.append(f"history.bag={self._store.lay_out(job.history, folder / 'history')}")
        scenario = parse_scenario(self._store.read(job.scenario).decode(), "scenario", overrides)
        options = NodeOptions(
            out=folder,
            pacing=job.pacing,
            rate=job.rate,
            start_timeout_sec=job.start_timeout_sec,
            stall_timeout_sec=job.stall_timeout_sec,
            designs=None if job.designs is None else self._store.lay_out(job.designs, folder / "designs"),
            run=job.run,
        )
        self._say(f"{job.run}: {', '.join(name for members in job.nodes.values() for name in members)}")
        group = ProcessGroup(job.nodes, scenario, options, folder / "log")
        try:
            self._follow(group, told)
        finally:
            group.stop()
            self._say(f"{job.run}: over")
        for path in sorted((folder / "log").iterdir()):
            self._channel.send({"log": path.name}, path.read_bytes()[-_LOG_BYTES:])
        self._channel.send({"over": True})

    def _follow(self, group: ProcessGroup, told: Sequence[int]) -> None:
        """Tell the command how the nodes are, until it says stop."""
        due = 0.0
        while not self._over(told):
            message = self._channel.receive(_POLL_SEC)
            if message is not None:
                if "stop" in message.said:
                    return
                self._prepare(message)
            now = time.monotonic()
            if now > due:
                self._channel.send({"status": _status(group)})
                due = now + _STATUS_SEC
        self._say("the command is silent" if not told else "ended here")


def _status(group: ProcessGroup) -> dict[str, Any]:
    death = group.death()
    return {
        "death": None if death is None else [death.process, death.reason],
        "left": group.left(),
        "stopped": group.stopped(),
        "ended": group.has_ended(),
    }


def machine() -> str:
    """Return what two commands have in common if, and only if, they see the same network interfaces."""
    boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    return f"{boot} {Path('/proc/self/ns/net').stat().st_ino}"


def _check_address(address: str) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((address, 0))
        except OSError:
            raise HostsError(f"{address} is no address of that machine ({socket.gethostname()})") from None
