"""A host as the command sees it: reached by TCP or ssh, told its part, and asked how it is."""

from __future__ import annotations

import shlex
import socket
import subprocess
import tempfile
import time
from typing import TYPE_CHECKING, Any

from dcmg_bringup.hosts.channel import CHUNK_BYTES, Channel, Side
from dcmg_bringup.hosts.errors import ChannelError, HostsError
from dcmg_bringup.hosts.offsets import Offset, better, measured
from dcmg_bringup.hosts.versions import differing
from dcmg_bringup.processes import Death

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from dcmg_bringup.hosts.hosts_file import HostSettings
    from dcmg_bringup.hosts.job import HostJob

_CONNECT_SEC, _SSH_SEC, _ANSWER_SEC = 10.0, 60.0, 30.0
_PING_SEC = 0.5
_PINGS = 8  # before the run: the best of them counts
SILENT_SEC = 5.0  # a link that is cut for two seconds is heard again after three, when TCP tries again
_SSH = ("ssh", "-T", "-o", "BatchMode=yes", "-o", "ConnectTimeout=10")


class RemoteHost:
    """One host of a run.

    Args:
        name: in the hosts file.
        settings: how it is reached.
        secret: shared with `dcmg host`; ssh needs none.

    Raises:
        HostsError: it cannot be reached, does not know the secret, or computes with something else.
    """

    def __init__(self, name: str, settings: HostSettings, secret: bytes) -> None:
        """Reach it and hear what it computes with."""
        self.name, self.address, self._settings = name, settings.address, settings
        self._ssh: subprocess.Popen[bytes] | None = None
        self._lost = ""
        self._status: dict[str, Any] = {"death": None, "left": [], "stopped": [], "ended": False}
        self._over = self._told_to_stop = False
        self._pinged = 0.0
        self.first: Offset | None = None
        self.offset: Offset | None = None
        self.logs: dict[str, bytes] = {}
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - closed with the channel
        try:
            self._channel = self._by_ssh(settings.ssh) if settings.ssh else self._by_tcp()
            self._channel.shake_hands(b"" if settings.ssh else secret, _SSH_SEC if settings.ssh else _CONNECT_SEC)
            hello = self._wait_for("versions")
        except ChannelError as error:
            raise self._cannot(error) from error
        if difference := differing(hello["versions"]):
            self.close()
            raise HostsError(f"host {name} ({self._where}) {difference}")
        self.machine, self.taken = str(hello["machine"]), {int(one) for one in hello["taken"]}

    @property
    def _where(self) -> str:
        return self._settings.ssh or f"{self.address}:{self._settings.port}"

    def _cannot(self, error: Exception) -> HostsError:
        self._errors.seek(0)
        said = self._errors.read().decode(errors="replace").strip()
        self.close()
        why = f": {said.splitlines()[-1]}" if said else ""
        return HostsError(f"host {self.name} ({self._where}) {error}{why}")

    def _by_tcp(self) -> Channel:
        try:
            found = socket.create_connection((self.address, self._settings.port), timeout=_CONNECT_SEC)
        except OSError as error:
            reason = error.strerror or "no answer"
            raise ChannelError(
                f"is not reached ({reason}): expected `dcmg host --listen {self._where}` there"
            ) from error
        found.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return Channel(found.fileno(), found.fileno(), Side.COMMAND, found.close)

    def _by_ssh(self, target: str) -> Channel:
        command = [*_SSH, "--", target, f"{shlex.quote(self._settings.command)} host --stdio"]
        try:
            self._ssh = process = subprocess.Popen(  # noqa: S603 - the user's own hosts file says what
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                start_new_session=True,  # Ctrl-C is for the command alone
                bufsize=0,
            )
        except OSError as error:
            raise ChannelError(f"is not reached: ssh: {error.strerror}") from error
        assert process.stdin is not None  # noqa: S101 - pipes were asked for
        assert process.stdout is not None  # noqa: S101
        return Channel(process.stdout.fileno(), process.stdin.fileno(), Side.COMMAND, self._end_ssh)

    def _end_ssh(self) -> None:
        if self._ssh is None:
            return
        for stream in (self._ssh.stdin, self._ssh.stdout):
            if stream is not None:
                stream.close()
        try:
            self._ssh.wait(_CONNECT_SEC)
        except subprocess.TimeoutExpired:
            self._ssh.kill()
            self._ssh.wait()

    def offer(self, job: HostJob, contents: Mapping[str, Path | bytes]) -> None:
        """Tell the host its part, and send the files that it lacks; measure its clock meanwhile.

        Raises:
            HostsError: it refuses.
        """
        try:
            for _ in range(_PINGS):
                self._channel.send({"ping": time.time_ns()})
                self._wait_for("pong")
            self._channel.send({"job": job.model_dump_json()})
            for digest in self._wait_for("lacks")["lacks"]:
                found = contents[digest]
                data = found if isinstance(found, bytes) else found.read_bytes()
                for at in range(0, max(1, len(data)), CHUNK_BYTES):
                    last = at + CHUNK_BYTES >= len(data)
                    self._channel.send({"file": digest, "last": last}, data[at : at + CHUNK_BYTES])
        except ChannelError as error:
            raise self._cannot(error) from error
        self.first = self.offset

    def start(self) -> None:
        """Let it start its nodes."""
        self._say({"start": True})

    def look(self) -> None:
        """Take what it has told, and ask for its time now and then."""
        now = time.monotonic()
        if now - self._pinged > _PING_SEC and not self._told_to_stop:
            self._pinged = now
            self._say({"ping": time.time_ns()})
        try:
            while not (self._lost or self._over) and (message := self._channel.receive()) is not None:
                self._take(message.said, message.payload)
        except ChannelError as error:
            self._lost = str(error)
        if not self._lost and now - self._channel.heard > SILENT_SEC:
            self._lost = f"no word for {SILENT_SEC:g} s"

    def death(self) -> Death | None:
        """Return what became of the host, or of a node there, if anything did."""
        if self._lost:
            return Death(process=self.name, reason=f"{self._where}: {self._lost}", kind="host", how="was lost")
        found = self._status["death"]
        if found is not None:
            return Death(process=str(found[0]), reason=f"{found[1]}", how=f"on host {self.name} ended")
        return None

    @property
    def left(self) -> list[str]:
        """Processes that ended well."""
        return [str(name) for name in self._status["left"]]

    @property
    def stopped(self) -> list[str]:
        """Processes that a signal has stopped."""
        return [str(name) for name in self._status["stopped"]]

    @property
    def has_ended(self) -> bool:
        """Whether no node is left there, or nobody knows."""
        return bool(self._lost or self._over or self._status["ended"])

    @property
    def is_over(self) -> bool:
        """Whether it has told everything."""
        return bool(self._lost or self._over)

    def stop(self) -> None:
        """Tell it to end its nodes; it answers with their logs."""
        if not self._told_to_stop:
            self._told_to_stop = True
            self._say({"stop": True})

    def close(self) -> None:
        """End the conversation."""
        if hasattr(self, "_channel"):
            self._channel.close()
        else:
            self._end_ssh()
        self._errors.close()

    def _say(self, said: dict[str, Any]) -> None:
        if self.is_over:
            return
        try:
            self._channel.send(said)
        except ChannelError as error:
            self._lost = str(error)

    def _take(self, said: dict[str, Any], payload: bytes) -> None:
        if "status" in said:
            self._status = said["status"]
        elif "pong" in said:
            found = measured(int(said["pong"]), int(said["clock_ns"]), time.time_ns())
            self.offset = better(self.offset, found)
            self.newest = found
        elif "log" in said:
            self.logs[str(said["log"])] = payload
        elif "refused" in said:
            self._lost = str(said["refused"])
        elif "over" in said:
            self._over = True

    def _wait_for(self, key: str) -> dict[str, Any]:
        """Take messages until one says `key`.

        Raises:
            ChannelError: it does not come, or a refusal does.
        """
        deadline = time.monotonic() + _ANSWER_SEC
        while (left := deadline - time.monotonic()) > 0.0:
            message = self._channel.receive(left)
            if message is None:
                break
            if "refused" in message.said:
                raise ChannelError(f"refuses: {message.said['refused']}")
            self._take(message.said, message.payload)
            if key in message.said:
                return message.said
        raise ChannelError("does not answer")
