"""A long run from end to end: recorded over ROS 2, checked, replayed; with the memory of every process on the way."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from bags.runs.run_record import RunRecord

_DCMG = (sys.executable, "-m", "dcmg")
_SAMPLE_SEC = 0.5
_KIB_PER_MB = 1e6 / 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """One command on the bag.

    Attributes:
        name: what was done.
        wall_sec: how long it took [s].
        peak_mb: peak resident memory of each process, by name [MB].
        ok: whether it did what it must.
        detail: in words.
    """

    name: str
    wall_sec: float
    peak_mb: dict[str, float]
    ok: bool
    detail: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SoakReport:
    """What a soak found.

    Attributes:
        steps: complete steps in the bag.
        megabytes: size of the bag [MB].
        limit_mb: what every process must stay below [MB].
        stages: recording, check and replay.
    """

    steps: int
    megabytes: float
    limit_mb: float
    stages: tuple[Stage, ...]

    @property
    def passed(self) -> bool:
        """Whether every stage did what it must, within the memory limit."""
        return all(stage.ok and max(stage.peak_mb.values()) < self.limit_mb for stage in self.stages)

    def document(self) -> dict[str, Any]:
        """For JSON."""
        return {**asdict(self), "passed": self.passed}


def soak(run_arguments: Sequence[str], out: Path, limit_mb: float, say: Callable[[str], None]) -> SoakReport:
    """Record, check and replay.

    Args:
        run_arguments: of `dcmg run`, without --out.
        out: folder of the run.
        limit_mb: what every process must stay below [MB].
        say: told before each stage.
    """
    bag = out / "bag"
    say("recording")
    stages = [_record([*run_arguments, "--no-plots", "--json", "--out", str(out)])]
    steps = 0
    if stages[0].ok:
        for name, work in (("check", _check), ("replay", _replay)):
            say(name)
            stages.append(_alone(name, work, bag))
        steps = _steps(bag)
    size = sum(file.stat().st_size for file in bag.glob("*"))
    return SoakReport(steps=steps, megabytes=size / 1e6, limit_mb=limit_mb, stages=tuple(stages))


def _record(arguments: Sequence[str]) -> Stage:
    start = time.monotonic()
    peaks: dict[str, float] = {}
    with subprocess.Popen(  # noqa: S603 (our own command)
        [*_DCMG, "run", *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        while True:
            for pid in (process.pid, *_children(process.pid)):
                peaks |= _peak(pid)
            try:
                out, err = process.communicate(timeout=_SAMPLE_SEC)
                break
            except subprocess.TimeoutExpired:
                continue
    wall_sec = time.monotonic() - start
    if process.returncode:
        last = err.strip().splitlines()[-1:] or [f"exit code {process.returncode}"]
        return Stage(name="record", wall_sec=wall_sec, peak_mb=peaks, ok=False, detail=last[0])
    steps = json.loads(out)["steps"]
    detail = f"{steps} steps, {steps / wall_sec:.0f} steps/s with start, end and report; nothing lost"
    return Stage(name="record", wall_sec=wall_sec, peak_mb=peaks, ok=True, detail=detail)


def _alone(name: str, work: Callable[[Path], tuple[bool, str]], bag: Path) -> Stage:
    """Do something in a fresh process, whose memory is then that of the work."""
    start = time.monotonic()
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        (ok, detail), peak_mb = pool.submit(_measured, work, bag).result()
    return Stage(name=name, wall_sec=time.monotonic() - start, peak_mb={name: peak_mb}, ok=ok, detail=detail)


def _measured(work: Callable[[Path], tuple[bool, str]], bag: Path) -> tuple[tuple[bool, str], float]:
    return work(bag), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / _KIB_PER_MB


def _check(bag: Path) -> tuple[bool, str]:
    from bags.mcap.check import check  # noqa: PLC0415 (heavy)

    report = check(bag)
    return report.clean, f"{report.messages} messages {'clean' if report.clean else 'damaged'}"


def _replay(bag: Path) -> tuple[bool, str]:
    """Replay and compare every conclusion of every monitor at every step with the recorded one, bit by bit."""
    from bags.runs.reader import open_run  # noqa: PLC0415 (heavy)
    from bags.runs.replay import replay_windows  # noqa: PLC0415
    from monitor.link_monitor import MonitorOutput  # noqa: PLC0415

    recorded: list[RunRecord] = []

    def noted() -> Iterator[RunRecord]:
        for window in open_run(bag).windows():
            recorded[:] = [window]
            yield window

    different = 0
    for again in replay_windows(noted()):
        (window,) = recorded
        arrays = [(getattr(again, name), getattr(window, name)) for name in MonitorOutput._fields]
        different += sum(one.tobytes() != other.tobytes() for one, other in arrays)
    return not different, "bit-identical residuals" if not different else f"{different} windows of arrays differ"


def _steps(bag: Path) -> int:
    from bags.runs.reader import open_run  # noqa: PLC0415 (heavy)

    return open_run(bag).steps


def _children(pid: int) -> list[int]:
    """Children and theirs, as far as they still run."""
    found: list[int] = []
    for file in Path(f"/proc/{pid}/task").glob("*/children"):
        try:
            direct = [int(child) for child in file.read_text().split()]
        except OSError:
            continue
        found += [one for child in direct for one in (child, *_children(child))]
    return found


def _peak(pid: int) -> dict[str, float]:
    """Peak resident memory of a process so far, by its name [MB]; empty when it is gone."""
    try:
        title = Path(f"/proc/{pid}/cmdline").read_text().replace("\0", " ").split()
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return {}
    peak = next((int(line.split()[1]) for line in status.splitlines() if line.startswith("VmHWM:")), None)
    if peak is None:
        return {}
    nodes = [word for word in title[2:] if title[:2] == ["dcmg", "node"]]
    nodes = nodes[: nodes.index("--out")] if "--out" in nodes else nodes
    name = nodes[0] if len(nodes) == 1 else ("all nodes, recorder included" if nodes else "supervisor and report")
    return {name: peak / _KIB_PER_MB}
