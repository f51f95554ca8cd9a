"""Real runs for the ROS tests: the command in processes of its own, in ROS domains that it chooses itself."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

import psutil
import pytest

from bags.watch.scenarios import load_scenario
from dcmg.shipped import scenario_path
from dcmg_bringup.domain import DomainError, choose_domain, running_systems

if TYPE_CHECKING:
    import signal
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from pathlib import Path

DCMG = (sys.executable, "-m", "dcmg")
STARTED_SEC = 60.0

# Noise, random loads, an attack with an end and a short calibration: whatever can differ between two runs is in it.
SHORT = (
    "name=short",
    "duration_sec=2.0",
    "noise={kind: gaussian, std: [0.001, 0.001, 0.0001]}",
    "dgus.0.load=[{kind: constant, current_a: 10}, {kind: uniform, low_a: -0.5, high_a: 0.5}]",
    "monitor.detector.options.settle_sec=0.1",
    "monitor.detector.options.calibrate_sec=0.5",
    "attacks.0.start_sec=1.0",
    "attacks.0.stop_sec=1.5",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Finished:
    """A command that has ended: exit code and what it wrote."""

    code: int
    out: str
    err: str


def run_dcmg(*arguments: str | Path, timeout_sec: float = 100.0) -> Finished:
    """Run `dcmg` to its end."""
    command = [*DCMG, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=timeout_sec, check=False)
    return Finished(code=done.returncode, out=done.stdout, err=done.stderr)


@dataclass(frozen=True, slots=True)
class Background:
    """A `dcmg run` that goes on while a test acts on it."""

    process: subprocess.Popen[str]
    out: Path

    @property
    def bag(self) -> Path:
        """The bag it writes."""
        return self.out / "bag"

    @property
    def domain(self) -> int:
        """The ROS domain that it has chosen."""
        (found,) = [system.domain for system in running_systems() if system.pid == self.process.pid]
        return found

    def nodes(self) -> Mapping[str, psutil.Process]:
        """The node processes by the name of their node."""
        found = {}
        for child in psutil.Process(self.process.pid).children(recursive=True):
            title = child.cmdline()
            if title and title[0].startswith("dcmg node "):
                found[title[0].split()[2]] = child
        return found

    def wait_until_recording(self) -> None:
        """Return once messages have reached the disk."""
        wait_until(lambda: self._recorded() > 100_000 or self.process.poll() is not None)
        assert self.process.poll() is None, self.end()

    def end(self, number: signal.Signals | None = None, timeout_sec: float = 60.0) -> Finished:
        """Send a signal, if any, and wait for the end."""
        if number is not None:
            self.process.send_signal(number)
        out, err = self.process.communicate(timeout=timeout_sec)
        return Finished(code=self.process.returncode, out=out, err=err)

    def _recorded(self) -> int:
        return sum(path.stat().st_size for path in self.bag.glob("*.mcap"))


def wait_until(condition: Callable[[], bool], timeout_sec: float = STARTED_SEC) -> None:
    """Poll until the condition holds; fail when it does not in time."""
    deadline = time.monotonic() + timeout_sec
    while not condition():
        assert time.monotonic() < deadline, "the awaited condition did not come true"
        time.sleep(0.02)  # the pace of polling, not a wait


@contextmanager
def background_run(out: Path, *arguments: str | Path) -> Iterator[Background]:
    """Start `dcmg run … --out out` and see to its end."""
    command = [*DCMG, "run", *map(str, arguments), "--no-plots", "--out", str(out)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield Background(process, out)
        finally:
            if process.poll() is None:
                process.kill()


_FIRST_DOMAIN, _DOMAINS_PER_WORKER = 34, 17  # for four workers; `dcmg run` takes the lowest that are free


@pytest.fixture
def free_domain() -> int:
    """A ROS domain that is free, and that no other worker and no run that chooses for itself takes meanwhile."""
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")) % 4
    turn = time.monotonic_ns()
    for one in range(_DOMAINS_PER_WORKER):
        domain = _FIRST_DOMAIN + worker * _DOMAINS_PER_WORKER + (turn + one) % _DOMAINS_PER_WORKER
        try:
            with choose_domain(domain):
                return domain
        except DomainError:
            continue
    pytest.fail("no ROS domain is free")


@pytest.fixture(scope="session")
def dcmg() -> Callable[..., Finished]:
    """`dcmg`, run to its end."""
    return run_dcmg


@pytest.fixture
def start_run(tmp_path: Path) -> Iterator[Callable[..., Background]]:
    """Start runs in the background; they are over when the test is."""
    with_blocks = []

    def start(*arguments: str | Path, name: str = "run") -> Background:
        block = background_run(tmp_path / name, *arguments)
        with_blocks.append(block)
        return block.__enter__()

    yield start
    for block in with_blocks:
        block.__exit__(None, None, None)


@pytest.fixture(scope="session")
def short_scenario(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """File of a two-second scenario with noise, random loads and an attack on link 1-2 from 1.0 s to 1.5 s."""
    path = tmp_path_factory.mktemp("scenario") / "short.yaml"
    path.write_text(load_scenario(scenario_path("gallo_six_dgu"), SHORT).to_yaml())
    return path


@pytest.fixture(scope="session")
def short_runs(short_scenario: Path, tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, tuple[Path, Finished]]:
    """The short scenario run in processes (twice), composed, and simulated: bag and what the command said."""
    folder = tmp_path_factory.mktemp("runs")
    kinds: Mapping[str, Sequence[str]] = {
        "processes": ("run",),
        "processes again": ("run",),
        "composed": ("run", "--composed"),
        "simulated": ("simulate",),
    }
    runs = {}
    for kind, (command, *options) in kinds.items():
        out = folder / kind.replace(" ", "_")
        finished = run_dcmg(command, short_scenario, *options, "--no-plots", "--json", "--out", out)
        assert finished.code == 0, f"{kind}: {finished.err}"
        runs[kind] = (out / "bag", finished)
    return runs


@pytest.fixture(scope="session")
def long_scenario(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """File of a ten-minute scenario without attacks, for tests that end the run themselves."""
    path = tmp_path_factory.mktemp("scenario") / "long.yaml"
    changes = ("name=long", "duration_sec=600.0", "attacks=[]")
    path.write_text(load_scenario(scenario_path("gallo_six_dgu"), changes).to_yaml())
    return path
