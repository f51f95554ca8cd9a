"""Node processes: started, watched and stopped together; none outlives the command that started it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

_INTERRUPT_GRACE_SEC = 3.0
_TERMINATE_GRACE_SEC = 1.0
_POLL_SEC = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class Death:
    """A node process that ended with an error.

    Attributes:
        process: name of the process.
        reason: signal name or exit code, and the last line it wrote.
    """

    process: str
    reason: str


class ProcessGroup:
    """A set of named child processes, each with its own log file.

    Args:
        commands: process name → arguments of `python -m dcmg_nodes`.
        environment: variables added to ours.
        log_dir: folder that gets one `<name>.log` each.
    """

    def __init__(self, commands: Mapping[str, Sequence[str]], environment: Mapping[str, str], log_dir: Path) -> None:
        """Start every process."""
        log_dir.mkdir(parents=True, exist_ok=True)
        self._log_dir = log_dir
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        for name, arguments in commands.items():
            with (log_dir / f"{name}.log").open("wb") as log:
                self._processes[name] = subprocess.Popen(  # noqa: S603 (our own interpreter and module)
                    [sys.executable, "-m", "dcmg_nodes", *arguments],
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    env={**os.environ, **environment},
                    start_new_session=True,  # Ctrl-C reaches us alone; we stop the nodes in order
                )

    def death(self) -> Death | None:
        """Return the first process that ended with an error, if any."""
        for name, process in self._processes.items():
            if process.poll():
                return Death(process=name, reason=self._reason(name, process.returncode))
        return None

    def wait(self, timeout_sec: float) -> bool:
        """Wait for all processes to end by themselves; tell whether they did."""
        deadline = time.monotonic() + timeout_sec
        while any(process.poll() is None for process in self._processes.values()):
            if time.monotonic() > deadline:
                return False
            time.sleep(_POLL_SEC)
        return True

    def stop(self) -> None:
        """Interrupt what still runs, and insist: after this call no process is left."""
        for number, grace_sec in (
            (signal.SIGINT, _INTERRUPT_GRACE_SEC),
            (signal.SIGTERM, _TERMINATE_GRACE_SEC),
            (signal.SIGKILL, _TERMINATE_GRACE_SEC),
        ):
            for process in self._processes.values():
                if process.poll() is None:
                    process.send_signal(number)
            if self.wait(grace_sec):
                return

    def _reason(self, name: str, code: int) -> str:
        text = (self._log_dir / f"{name}.log").read_text(errors="replace").strip()
        last = f": {text.splitlines()[-1]}" if text else ""
        how = f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
        return f"{how}{last}"
