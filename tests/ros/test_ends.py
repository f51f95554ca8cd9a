"""How runs end: killed nodes, stalled nodes, Ctrl-C, runs side by side."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import psutil
import pytest

from bags.runs.reader import read_run

if TYPE_CHECKING:
    from collections.abc import Callable


def shared_memory() -> set[str]:
    """Names of the shared-memory files of this machine."""
    return {path.name for path in Path("/dev/shm").iterdir()}  # noqa: S108 (where Fast DDS would leave files)


def assert_gone(processes: list[psutil.Process]) -> None:
    """Fail when one of the processes still runs."""
    _, alive = psutil.wait_procs(processes, timeout=0.0)
    assert [process.cmdline() for process in alive] == []


@pytest.mark.parametrize("victim", ["dgu_3", "monitor_2", "attacker", "recorder"])
def test_a_killed_node_ends_the_run_and_leaves_a_bag(
    start_run: Callable[..., Any], long_scenario: Path, victim: str
) -> None:
    """SIGKILL of a node: one line with node and step, a non-zero exit, a readable bag, nothing left."""
    memory = shared_memory()
    run = start_run(long_scenario)
    run.wait_until_recording()
    nodes = run.nodes()
    assert len(nodes) == 15
    nodes[victim].kill()
    finished = run.end()
    assert finished.code != 0
    said = re.search(rf"dcmg: node {victim} ended at step (\d+) \(killed by SIGKILL.*", finished.err)
    assert said is not None, finished.err
    record = read_run(run.bag)
    assert record.steps == int(said[1]) > 0
    assert_gone(list(nodes.values()))
    assert shared_memory() <= memory


def test_a_stopped_node_is_named(start_run: Callable[..., Any], long_scenario: Path) -> None:
    """A node that stands still without dying ends the run, is named, and is gone afterwards."""
    run = start_run(long_scenario)
    run.wait_until_recording()
    nodes = run.nodes()
    nodes["dgu_4"].suspend()
    finished = run.end()
    assert finished.code != 0
    assert re.search(r"node dgu_4 stands still at step \d+ \(stopped by a signal\)", finished.err), finished.err
    assert read_run(run.bag).steps > 0
    assert_gone(list(nodes.values()))


@pytest.mark.parametrize(
    ("victim", "number", "said"),
    [
        ("clock", signal.SIGSTOP, "stands still"),
        ("recorder", signal.SIGTERM, "ended"),
        ("monitor_2", signal.SIGKILL, "ended"),
    ],
)
def test_a_node_that_fails_before_step_0_is_named(
    start_run: Callable[..., Any], long_scenario: Path, victim: str, number: signal.Signals, said: str
) -> None:
    """No node is blamed for another one's end, and nobody waits for the start time-out."""
    run = start_run(long_scenario)
    while len(run.nodes()) < 15:
        assert run.process.poll() is None
    nodes = run.nodes()
    nodes[victim].send_signal(number)
    finished = run.end()
    assert finished.code != 0
    assert f"node {victim} {said} at step 0" in finished.err
    assert "Traceback" not in finished.err
    assert_gone(list(nodes.values()))


def test_sigterm_ends_a_run_as_ctrl_c_does(start_run: Callable[..., Any], long_scenario: Path) -> None:
    """SIGTERM of `dcmg run`: a closed bag, no process left."""
    run = start_run(long_scenario, "--composed")
    run.wait_until_recording()
    nodes = list(run.nodes().values())
    assert run.end(signal.SIGTERM).code == 130
    assert read_run(run.bag).steps > 0
    assert_gone(nodes)


def test_too_few_files_for_all_nodes_is_one_line(long_scenario: Path, tmp_path: Path) -> None:
    """A machine that gives no process or file more: one line, nothing left."""
    command = [sys.executable, "-m", "dcmg", "run", str(long_scenario), "--no-plots", "--out", str(tmp_path / "run")]
    limited = ["sh", "-c", 'ulimit -n 24; exec "$@"', "sh", *command]
    done = subprocess.run(limited, capture_output=True, text=True, timeout=100.0, check=False)
    assert done.returncode != 0
    assert "Traceback" not in done.stderr
    everybody = psutil.process_iter(["cmdline"])
    assert [one.pid for one in everybody if str(tmp_path) in " ".join(one.info["cmdline"] or ())] == []


@pytest.mark.parametrize("options", [(), ("--composed",)])
def test_ctrl_c_closes_the_bag(start_run: Callable[..., Any], long_scenario: Path, options: tuple[str, ...]) -> None:
    """SIGINT ends the run cleanly, in processes and composed: a closed bag, no process left."""
    run = start_run(long_scenario, *options)
    run.wait_until_recording()
    nodes = list(run.nodes().values())
    finished = run.end(signal.SIGINT)
    assert finished.code == 130
    assert "interrupted at step" in finished.err
    assert "Traceback" not in finished.err
    assert read_run(run.bag).steps > 0
    assert_gone(nodes)


def test_nodes_die_with_a_killed_supervisor(start_run: Callable[..., Any], long_scenario: Path) -> None:
    """SIGKILL of `dcmg run` itself: its nodes end too, stopped ones as well, and the recorder still closes the bag."""
    run = start_run(long_scenario)
    run.wait_until_recording()
    nodes = run.nodes()
    for name in ("dgu_1", "recorder"):
        nodes[name].suspend()
    run.process.kill()
    gone, alive = psutil.wait_procs(nodes.values(), timeout=30.0)
    assert (len(gone), alive) == (15, [])
    assert read_run(run.bag).steps > 0


def test_nodes_die_with_a_supervisor_that_is_killed_while_it_starts_them(
    start_run: Callable[..., Any], long_scenario: Path
) -> None:
    """A node whose parent is gone before it could ask to be told ends by itself."""
    run = start_run(long_scenario)
    supervisor = psutil.Process(run.process.pid)
    nodes: list[psutil.Process] = []
    while len(nodes) < 3:
        nodes = supervisor.children()
    supervisor.suspend()  # no further node comes while we look
    nodes = supervisor.children()
    supervisor.kill()
    gone, alive = psutil.wait_procs(nodes, timeout=30.0)
    assert (len(gone), alive) == (len(nodes), [])


def test_two_runs_side_by_side_do_not_see_each_other(
    start_run: Callable[..., Any], long_scenario: Path, short_scenario: Path
) -> None:
    """A run that starts beside another one ends by itself with all its steps, while the other goes on."""
    first = start_run(long_scenario, "--composed", name="first")
    first.wait_until_recording()
    second = start_run(short_scenario, "--composed", name="second").end()
    assert second.code == 0, second.err
    assert first.process.poll() is None
    assert first.end(signal.SIGINT).code == 130
    assert read_run(first.out / "bag").topics == read_run(first.out.parent / "second" / "bag").topics
