"""A folder of its own for one case: what runs in it, what it leaves behind, and where it stands."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import psutil

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

DCMG = (sys.executable, "-m", "dcmg")
_SHARED = Path("/dev/shm")  # noqa: S108 - where Fast DDS would leave files
_POLL_SEC = 0.005
_GIVEN_UP_SEC = 120.0  # what nothing may take, however busy the machine


@dataclass(frozen=True, slots=True)
class Scene:
    """What runs below a folder, whatever it calls itself: known by their working directory.

    Attributes:
        folder: it must be new.
    """

    folder: Path

    def start(self, *arguments: str | Path) -> subprocess.Popen[str]:
        """Start a `dcmg` command in the folder."""
        home = self.folder / "home"
        home.mkdir(parents=True, exist_ok=True)
        log = (self.folder / "said").open("w")
        try:
            return subprocess.Popen(
                [*DCMG, *map(str, arguments)],
                cwd=self.folder,
                env={**os.environ, "HOME": str(home)},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                text=True,
            )
        finally:
            log.close()

    def said(self) -> str:
        """What the last command wrote."""
        return (self.folder / "said").read_text(errors="replace")

    def processes(self) -> list[psutil.Process]:
        """Everything alive in the folder."""
        found = []
        for process in psutil.process_iter():
            try:
                if Path(process.cwd()).is_relative_to(self.folder) and process.status() != psutil.STATUS_ZOMBIE:
                    found.append(process)
            except (psutil.Error, OSError):
                continue
        return found

    def left(self) -> list[str]:
        """What is left behind: processes, and files beside the output."""
        left = [f"process {one.pid} {' '.join(one.cmdline())[:60]}" for one in self.processes()]
        home = self.folder / "home"
        return left + [str(one.relative_to(home)) for one in home.rglob("*") if one.is_file()]

    def clear(self) -> None:
        """End what is left, and remove the folder."""
        for process in self.processes():
            process.kill()
        shutil.rmtree(self.folder, ignore_errors=True)


def shared_memory() -> set[str]:
    """Names of this machine's shared-memory files of DDS."""
    return {path.name for path in _SHARED.glob("*fastrtps*")}


def unowned(names: set[str]) -> set[str]:
    """Those of the shared-memory files that no living process uses: other programs' own are theirs."""
    used = "".join(_used_by(process) for process in Path("/proc").glob("[0-9]*")) if names else ""
    there = {path.name for path in _SHARED.iterdir()}
    return {name for name in names & there if f"{name.removeprefix('sem.')}\n" not in used and f"{name}\n" not in used}


def _used_by(process: Path) -> str:
    """What a process has mapped, and what it holds open: the files of locks are not mapped."""
    told = ""
    with suppress(OSError):  # it has ended, or is another user's
        told = (process / "maps").read_text()
        for one in (process / "fd").iterdir():
            with suppress(OSError):
                told += f"{one.readlink()}\n"
    return told


def wait_until(condition: Callable[[], bool], timeout_sec: float = _GIVEN_UP_SEC) -> bool:
    """Poll until the condition holds; tell whether it does."""
    deadline = time.monotonic() + timeout_sec
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(_POLL_SEC)
    return True


def children(process: subprocess.Popen[str]) -> list[psutil.Process]:
    """Its children, in the order in which they were started."""
    try:
        return psutil.Process(process.pid).children()
    except psutil.Error:
        return []


def nodes(process: subprocess.Popen[str]) -> dict[str, psutil.Process]:
    """Node processes by name, of a `dcmg run`."""
    found = {}
    for child in children(process):
        try:
            title = child.cmdline()
        except psutil.Error:
            continue
        if title and title[0].startswith("dcmg node "):
            found[title[0].split()[2]] = child
    return found


def stacks(processes: Sequence[psutil.Process]) -> str:
    """Where each process stands, all threads: by py-spy or gdb where they are there, else what the kernel tells."""
    texts = []
    for process in processes:
        try:
            head = f"== {process.pid} {process.status()} {' '.join(process.cmdline())[:100]}"
        except psutil.Error:
            continue
        texts.append(f"{head}\n{_stack(process.pid)}")
    return "\n".join(texts)


def _stack(pid: int) -> str:
    spy = shutil.which("py-spy") or shutil.which("py-spy", path=str(Path(sys.executable).parent))
    gdb = shutil.which("gdb")
    tools = [[spy, "dump", "--pid", str(pid)]] if spy else []
    tools += [[gdb, "-p", str(pid), "-batch", "-ex", "thread apply all bt 30"]] if gdb else []
    if not tools:
        tasks = sorted(Path(f"/proc/{pid}/task").glob("*/wchan"))
        return "\n".join(f"{task.parent.name} {task.read_text()}" for task in tasks)
    said = []
    for tool in tools:
        done = subprocess.run(tool, capture_output=True, text=True, timeout=60.0, check=False)
        said.append(done.stdout or done.stderr)
    return "\n".join(said)
