"""One run over three hosts, and what becomes of it when a cable is pulled or a host dies."""

from __future__ import annotations

import json
import re
import time
from typing import TYPE_CHECKING

from bags.mcap.check import check
from tests.hosts.conftest import COMPARED
from tests.hosts.lab import DCMG
from tests.ros.conftest import run_dcmg, wait_until
from tests.ros.test_identity import payloads

if TYPE_CHECKING:
    import subprocess
    from collections.abc import Callable
    from pathlib import Path

    from tests.hosts.lab import Lab

CUT_SEC = 2.0
CHANGES = (
    *("--set", "noise={kind: gaussian, std: [0.001, 0.001, 0.0001]}"),
    *("--set", "dgus.0.load=[{kind: constant, current_a: 10}, {kind: uniform, low_a: -0.5, high_a: 0.5}]"),
    *("--set", "monitor.detector.options.settle_sec=0.1"),
    *("--set", "monitor.detector.options.calibrate_sec=0.5"),
    *("--set", "attacks.0.start_sec=3.0"),
)


def _run(lab: Lab, folder: Path, duration: str, *options: str) -> subprocess.Popen[str]:
    arguments = ("gallo_six_dgu", "--duration", duration, *CHANGES, "--hosts", str(folder / "hosts.yaml"), *options)
    return lab.start("lab1", *DCMG, "run", *arguments, "--no-plots", "--out", str(folder / "run"))


def _wait_for_bytes(process: subprocess.Popen[str], folder: Path, wanted: int) -> None:
    def recorded() -> int:
        return sum(path.stat().st_size for path in (folder / "run" / "bag").glob("*.mcap"))

    wait_until(lambda: recorded() > wanted or process.poll() is not None)
    assert process.poll() is None, process.communicate()


def test_a_cable_pulled_for_two_seconds_changes_no_byte(lab: Lab, tmp_path: Path) -> None:
    """The bag is that of a run without ROS, hence of one host; the other interfaces carried nothing."""
    before = {name: lab.packets(name, "other0") for name in lab.machines}
    process = _run(lab, tmp_path, "8")
    _wait_for_bytes(process, tmp_path, 100_000)
    lab.cut("lab3")
    time.sleep(CUT_SEC)  # what is tried
    lab.mend("lab3")
    assert process.poll() is None, process.communicate()
    _, err = process.communicate(timeout=100.0)
    assert process.returncode == 0, err
    assert {name: lab.packets(name, "other0") for name in lab.machines} == before
    assert lab.packets("lab2", "run0") > 1000
    alone = run_dcmg(
        "simulate", "gallo_six_dgu", "--duration", "8", *CHANGES, "--no-plots", "--out", tmp_path / "alone"
    )
    assert alone.code == 0, alone.err
    expected, found = payloads(tmp_path / "alone" / "bag"), payloads(tmp_path / "run" / "bag")
    assert found.keys() == expected.keys()
    assert [topic for topic in expected if found[topic] != expected[topic]] == []
    said = json.loads((tmp_path / "run" / "hosts.json").read_text())
    assert all(abs(one["clock_offset_ns"]) <= one["clock_offset_bound_ns"] for one in said.values())
    messages = sum(map(len, found.values()))
    COMPARED.append(f"3 hosts, {len(found)} topics, {messages} messages, a cable out for {CUT_SEC:g} s: bit-identical")


def _ends_with(process: subprocess.Popen[str], folder: Path, pattern: str) -> None:
    _, err = process.communicate(timeout=60.0)
    assert process.returncode == 1
    assert re.search(pattern, err.splitlines()[-1]), err
    assert check(folder / "run" / "bag").clean


def test_a_cable_pulled_for_good(lab: Lab, tmp_path: Path) -> None:
    """The host is named with the step, the bag is closed, and no node is left on any host."""
    process = _run(lab, tmp_path, "600")
    _wait_for_bytes(process, tmp_path, 100_000)
    lab.cut("lab3")
    _ends_with(
        process, tmp_path, r"dcmg: host lab3 was lost at step \d+ \(10\.9\.0\.3:7350: no word for 5 s\); the bag"
    )
    for name in lab.machines:
        wait_until(_no_nodes(lab, name))
    COMPARED.append("a cable out for good: named, bag closed, no node left")


def test_a_host_that_dies(lab: Lab, tmp_path: Path) -> None:
    """So is one that is switched off; and a node of it that is killed by itself is named with its host."""
    process = _run(lab, tmp_path, "600")
    _wait_for_bytes(process, tmp_path, 100_000)
    lab.kill("lab2")
    _ends_with(process, tmp_path, r"dcmg: host lab2 was lost at step \d+ \(10\.9\.0\.2:7350: (closed|no word)")
    for name in lab.machines:
        wait_until(_no_nodes(lab, name))
    COMPARED.append("a host switched off: likewise")


def _no_nodes(lab: Lab, name: str) -> Callable[[], bool]:
    return lambda: not any(title.startswith("dcmg node") for title in lab.processes(name))
