"""Node processes: started, watched and stopped together; none outlives the command that started it.

They are forked from this process, which has imported everything but rclpy and has read the scenario: fifteen
interpreters that each do that anew need seven seconds on two cores, fifteen forks two. rclpy comes only after the
fork, because its libraries start threads.
"""

from __future__ import annotations

import gc
import importlib
import math
import multiprocessing
import os
import resource
import signal
import sys
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import setproctitle

from bags.orphans import die_with, is_stopped
from dcmg.errors import CommandError
from dcmg_bringup.interruptions import end_by_signals, held_back
from dcmg_bringup.reaper import Reaper
from dcmg_nodes.options import GATE
from dcmg_nodes.wiring import RECORDER_NODE

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from multiprocessing.context import ForkProcess
    from pathlib import Path

    from dcmg_nodes.options import GateOptions, NodeOptions
    from dgu_sim.scenario import Scenario

_INTERRUPT_GRACE_SEC = 3.0
_TERMINATE_GRACE_SEC = 1.0
_POLL_SEC = 0.02
_EXIT_FAILED = 1
_FILES = 256  # what a node with its DDS participant opens, and some
# what the nodes import, as far as it does not import rclpy
_PRELOADED = (
    "bags.watch.histories",
    "bags.mcap.writer",
    "dcmg_nodes.wiring",
    "dgu_sim.simulate",
    "monitor.detectors",
    "monitor.link_monitor",
    "monitor.observers",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Death:
    """A node process that ended with an error.

    Attributes:
        process: name of the process.
        reason: signal name or exit code, and the last line it wrote.
        kind: what it is.
        how: what became of it.
    """

    process: str
    reason: str
    kind: str = "node"
    how: str = "ended"


class ProcessGroup:
    """A set of named child processes, each with its own log file.

    Args:
        nodes: process name → names of the nodes it holds.
        scenario: what they run.
        options: how they run it.
        log_dir: folder that gets one `<name>.log` each.
        gate: where outsiders meet the run, None: in the domain of its nodes. No run ends for its gate.

    Raises:
        CommandError: the machine gives no process, file or memory more; what was started has been ended.
        RuntimeError: rclpy is imported already, so that forking is not safe.
    """

    def __init__(
        self,
        nodes: Mapping[str, Sequence[str]],
        scenario: Scenario,
        options: NodeOptions,
        log_dir: Path,
        gate: GateOptions | None = None,
    ) -> None:
        """Start every process."""
        if "rclpy" in sys.modules:
            raise RuntimeError("node processes must be started before rclpy is imported")
        _allow_files(len(nodes))
        for module in _PRELOADED:
            importlib.import_module(module)
        gc.freeze()  # what is there now stays: collecting it again and again would cost, and unshare its memory
        log_dir.mkdir(parents=True, exist_ok=True)
        self._log_dir = log_dir
        self._processes: dict[str, ForkProcess] = {}
        self._recording = {name for name, members in nodes.items() if RECORDER_NODE in members}
        self._reaper: Reaper | None = None
        try:
            self._start(nodes, scenario, options, gate)
        except OSError as error:
            self.stop()
            started = f"{len(self._processes)} of {len(nodes)} node processes"
            raise CommandError(f"only {started} could be started: {error.strerror}: see `ulimit -a`") from error
        except BaseException:
            self.stop()
            raise

    def _start(
        self,
        nodes: Mapping[str, Sequence[str]],
        scenario: Scenario,
        options: NodeOptions,
        gate: GateOptions | None,
    ) -> None:
        self._reaper = reaper = Reaper()
        for name, members in nodes.items():
            log = self._log_dir / f"{name}.log"
            self._fork(name, _node_process, (os.getpid(), reaper, log, members, (scenario, options)))
        if gate is not None:
            self._fork(GATE, _gate_process, (os.getpid(), reaper, self._log_dir / f"{GATE}.log", scenario, gate))

    def _fork(self, name: str, target: Callable[..., None], arguments: tuple[object, ...]) -> None:
        process = multiprocessing.get_context("fork").Process(target=target, args=arguments, name=name)
        with held_back():
            process.start()
            self._processes[name] = process
            if process.pid is not None and self._reaper is not None:
                self._reaper.look_after(process.pid)

    @property
    def _nodes(self) -> dict[str, ForkProcess]:
        return {name: process for name, process in self._processes.items() if name != GATE}

    @property
    def pids(self) -> tuple[int, ...]:
        """Process ids of all processes, dead ones included."""
        return tuple(process.pid for process in self._processes.values() if process.pid is not None)

    def death(self) -> Death | None:
        """Return the first process that ended with an error, if any."""
        for name, process in self._nodes.items():
            if process.exitcode:
                return Death(process=name, reason=self._reason(name, process.exitcode))
        return None

    def left(self) -> list[str]:
        """Return the names of the processes that ended well."""
        return [name for name, process in self._nodes.items() if process.exitcode == 0]

    def stopped(self) -> list[str]:
        """Return the names of the processes that a signal has stopped (SIGSTOP, SIGTSTP)."""
        return [name for name, process in self._nodes.items() if is_stopped(process.pid)]

    def has_ended(self) -> bool:
        """Whether no node is left."""
        return all(process.exitcode is not None for process in self._nodes.values())

    def wait(self, timeout_sec: float) -> bool:
        """Wait for all processes to end by themselves; tell whether they did."""
        deadline = time.monotonic() + timeout_sec
        while any(process.exitcode is None for process in self._processes.values()):
            if time.monotonic() > deadline:
                return False
            time.sleep(_POLL_SEC)
        return True

    def stop(self) -> None:
        """Interrupt the recorder, which closes its bag, and the gate, which says what it heard; kill the others.

        After this call no process is left.
        """
        for name, process in self._processes.items():
            if name not in self._recording and name != GATE and process.exitcode is None:
                process.kill()
        for number, grace_sec in (
            (signal.SIGINT, _INTERRUPT_GRACE_SEC),
            (signal.SIGTERM, _TERMINATE_GRACE_SEC),
            (signal.SIGKILL, _TERMINATE_GRACE_SEC),
        ):
            for process in self._processes.values():
                if process.exitcode is None and process.pid is not None:
                    os.kill(process.pid, number)
                    os.kill(process.pid, signal.SIGCONT)  # one that is stopped takes no other signal
            if self.wait(grace_sec):
                break
        if self._reaper is not None:
            self._reaper.dismiss()
            self._reaper = None

    def where(self, node: str) -> str:  # noqa: ARG002 - another group knows other hosts
        """Say on which other host a node is: on none."""
        return ""

    def _reason(self, name: str, code: int) -> str:
        log = self._log_dir / f"{name}.log"
        text = log.read_text(errors="replace").strip() if log.exists() else ""
        last = f": {text.splitlines()[-1]}" if text else ""
        how = f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
        return f"{how}{last}"


def _allow_files(processes: int) -> None:
    """Ask for as many open files as the processes need, or refuse before anything starts."""
    needed = _FILES + 2 * processes
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = math.inf if hard == resource.RLIM_INFINITY else hard
    if most < needed:
        raise CommandError(f"{hard} open files are allowed, a run of {processes} processes needs {needed}: `ulimit -n`")
    if soft != resource.RLIM_INFINITY and soft < needed:
        resource.setrlimit(resource.RLIMIT_NOFILE, (needed, hard))


def _node_process(
    parent: int, reaper: Reaper, log: Path, members: Sequence[str], what: tuple[Scenario, NodeOptions]
) -> None:
    """Be a node process."""
    end_by_signals()
    die_with(parent, signal.SIGINT if RECORDER_NODE in members else signal.SIGKILL)  # a recorder closes its bag
    scenario, options = what
    _stand_alone(reaper, log, f"dcmg node {' '.join(members)} --out {options.out}")
    from dcmg_nodes.main import run_nodes  # noqa: PLC0415 (imports rclpy, which must follow the fork)

    failure = run_nodes(members, scenario, options)
    if failure is not None:
        sys.stderr.write(f"{failure}\n")
        sys.stderr.flush()
        os._exit(_EXIT_FAILED)


def _gate_process(parent: int, reaper: Reaper, log: Path, scenario: Scenario, options: GateOptions) -> None:
    """Be the gate's process."""
    end_by_signals()
    die_with(parent)
    _stand_alone(reaper, log, f"dcmg {GATE} {options.folder}")
    from dcmg_nodes.gate import run_gate  # noqa: PLC0415 (imports rclpy, which must follow the fork)

    run_gate(scenario, options)


def _stand_alone(reaper: Reaper, log: Path, title: str) -> None:
    """Take a session (Ctrl-C reaches the supervisor alone), a log and a title of one's own."""
    reaper.forget()
    os.setsid()
    handle = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
    null = os.open(os.devnull, os.O_RDONLY)
    for source, target in ((null, 0), (handle, 1), (handle, 2)):
        os.dup2(source, target)
    setproctitle.setproctitle(title)
