"""The flow by hand that the README shows, typed as it stands there."""

from __future__ import annotations

import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from bags.runs.reader import read_run
from dcmg_bringup.domain import running_systems
from dgu_sim.relay import Origin

README = Path(__file__).parents[2] / "README.md"
DCMG = Path(sys.executable).with_name("dcmg")
_STARTED_SEC = 90.0


def _typed(block: str) -> list[list[str]]:
    return [[str(DCMG), *shlex.split(line)[1:]] for line in block.strip().splitlines()]


@pytest.fixture
def commands() -> tuple[list[str], list[list[str]]]:
    """The command of the first terminal, and those of the second."""
    blocks = re.findall(r"```sh\n(dcmg .*?)```", README.read_text(encoding="utf-8"), flags=re.DOTALL)
    ((run,), by_hand) = [_typed(block) for block in blocks]
    return run, by_hand


def test_the_flow_by_hand(
    commands: tuple[list[str], list[list[str]]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, free_domain: int
) -> None:
    """A run until Ctrl-C says its domain and obeys the one that is set; attacks reach it; the table and report come."""
    run, (start, listing, stop) = commands
    domain = free_domain
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    monkeypatch.chdir(tmp_path)
    with subprocess.Popen(run, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            deadline = time.monotonic() + _STARTED_SEC
            while subprocess.run(start, capture_output=True, check=False).returncode:
                assert process.poll() is None, process.communicate()
                assert time.monotonic() < deadline
            assert domain in [system.domain for system in running_systems()]
            listed = subprocess.run(listing, capture_output=True, text=True, check=True)
            assert "bias" in listed.stdout
            attached = subprocess.run(
                [DCMG, "attach", "--", "env"], capture_output=True, text=True, check=True, env={**os.environ}
            )
            assert f"ROS_DOMAIN_ID={domain}" in attached.stdout
            assert "clean from step" in subprocess.run(stop, capture_output=True, text=True, check=True).stdout
        finally:
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=60.0)
    assert process.returncode == 0, err
    assert f"export ROS_DOMAIN_ID={domain}" in err
    assert "3 → 4" in out
    record = read_run(tmp_path / "out/by-hand/bag")
    events = [(event.action.value, str(event.link)) for event in record.events if event.origin is Origin.SERVICE]
    assert events == [("start", "3-4"), ("stop", "3-4")], record.events
    report = subprocess.run([DCMG, "report", "out/by-hand/bag"], capture_output=True, text=True, check=True)
    assert "bias on 3-4" in report.stdout
