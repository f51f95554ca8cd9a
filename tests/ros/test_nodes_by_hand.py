"""`dcmg node`: processes that nobody supervises look after each other."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from bags.mcap.check import check
from bags.runs.reader import read_run
from tests.ros.conftest import DCMG, Finished, wait_until

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

FIRST = ("clock", "attacker", "dgu_1", "dgu_2")
SECOND = (*(f"dgu_{number}" for number in range(3, 7)), *(f"monitor_{number}" for number in range(1, 7)), "recorder")
SHORT = ("duration_sec=1.0", "attacks=[]")
LONG = ("duration_sec=600.0", "attacks=[]")
BLIND = "import dcmg_nodes.companions as it; it._PROBE_SEC, it._LOOK_SEC = 0.0, 5.0; from dcmg.cli import main; main()"


@pytest.fixture(name="start")
def _start(free_domain: int, tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Start named nodes of the six-DGU grid in a domain of the test's own; they are over when the test is."""
    running = []

    def started(
        names: tuple[str, ...], changes: tuple[str, ...], *options: str, out: str = "out", blind: bool = False
    ) -> subprocess.Popen[str]:
        sets = [word for change in changes for word in ("--set", change)]
        dcmg = (sys.executable, "-c", BLIND) if blind else DCMG
        command = [*dcmg, "node", *names, "--scenario", "gallo_six_dgu", "--out", str(tmp_path / out), *sets, *options]
        # without shared memory, of which a killed process leaves files that other tests would find
        environment = {**os.environ, "ROS_DOMAIN_ID": str(free_domain), "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}
        running.append(
            subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        )
        return running[-1]

    yield started
    for one in running:
        if one.poll() is None:
            one.send_signal(signal.SIGINT)
            one.communicate(timeout=60.0)


def _ended(process: subprocess.Popen[str]) -> Finished:
    out, err = process.communicate(timeout=60.0)
    return Finished(code=process.returncode, out=out, err=err)


def _records(folder: Path) -> bool:
    return sum(path.stat().st_size for path in (folder / "bag").glob("*.mcap")) > 100_000


def test_two_processes_make_a_run(start: Callable[..., subprocess.Popen[str]], tmp_path: Path) -> None:
    """All nodes are there: the run goes to its end, and its bag is clean."""
    both = start(FIRST, SHORT), start(SECOND, SHORT)
    assert [_ended(one).code for one in both] == [0, 0]
    assert check(tmp_path / "out" / "bag").clean
    assert read_run(tmp_path / "out" / "bag").steps == 100


def test_a_node_that_is_missing_is_named_by_all(start: Callable[..., subprocess.Popen[str]]) -> None:
    """It alone, not those that wait for it; nobody waits longer than told."""
    second = tuple(name for name in SECOND if name != "dgu_3")
    ended = [_ended(one) for one in [start(names, SHORT, "--start-timeout", "12") for names in (FIRST, second)]]
    for finished in ended:
        assert finished.code == 1
        assert finished.err.splitlines()[-1].endswith(("dgu_3", "is gone"))
    assert any(finished.err.endswith("dgu_3\n") for finished in ended)


def test_nodes_of_another_scenario_are_refused_by_both(start: Callable[..., subprocess.Popen[str]]) -> None:
    """Another seed on one host: both say so before step 0, with both seeds."""
    both = start(FIRST, SHORT), start(SECOND, (*SHORT, "seed=7"))
    for finished in map(_ended, both):
        assert finished.code == 1
        said = finished.err.splitlines()[-1]
        assert "seed 1, 100 steps" in said
        assert "seed 7, 100 steps" in said


def test_a_killed_process_ends_the_others(start: Callable[..., subprocess.Popen[str]], tmp_path: Path) -> None:
    """Those that are left name whom they wait for, and end with exit code 1."""
    left, killed = start(FIRST, LONG, "--stall-timeout", "2"), start(SECOND, LONG)
    wait_until(lambda: _records(tmp_path / "out") or left.poll() is not None)
    assert left.poll() is None, _ended(left).err
    killed.kill()
    _ended(killed)
    finished = _ended(left)
    assert finished.code == 1
    assert "nothing came for 2 s: waits for recorder, dgu_" in finished.err or "is gone" in finished.err


def test_whoever_comes_second_gives_way(start: Callable[..., subprocess.Popen[str]], tmp_path: Path) -> None:
    """A node that is there already, or a whole second system, is refused; the run goes on and its bag is clean."""
    run = start(FIRST, LONG), start(SECOND, LONG)
    wait_until(lambda: _records(tmp_path / "out") or any(one.poll() is not None for one in run))
    assert [one.poll() for one in run] == [None, None], [_ended(one).err for one in run]
    for names in (("dgu_3",), (*FIRST, *SECOND)):
        refused = _ended(start(names, LONG, out="other"))
        assert refused.code in {1, 2}
        assert "et another ROS_DOMAIN_ID" in refused.err
    for one in run:
        assert one.poll() is None
        one.send_signal(signal.SIGINT)
    assert [_ended(one).code for one in run] == [0, 0]
    assert check(tmp_path / "out" / "bag").clean


def test_a_system_that_finds_another_late_gives_way(
    start: Callable[..., subprocess.Popen[str]], tmp_path: Path
) -> None:
    """It has begun on its own, since it is whole; the older one goes on and its bag is clean."""
    first = start((*FIRST, *SECOND), LONG)
    wait_until(lambda: _records(tmp_path / "out") or first.poll() is not None)
    late = _ended(start((*FIRST, *SECOND), LONG, out="other", blind=True))
    assert late.code == 1
    assert "et another ROS_DOMAIN_ID" in late.err
    assert first.poll() is None
    first.send_signal(signal.SIGINT)
    assert _ended(first).code == 0
    assert check(tmp_path / "out" / "bag").clean
