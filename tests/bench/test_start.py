"""What a person waits for before anything happens: CPU time of short commands, in processes of their own."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import numpy as np
import pytest

import dcmg
from dcmg_bringup.domain import choose_domain

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

pytestmark = pytest.mark.bench

DCMG = (sys.executable, "-m", "dcmg")
_REPEATS = 3


def cpu_sec(command: Sequence[str], **environment: str) -> float:
    """CPU time of a process and its children, the least of a few tries [s]."""
    tries = []
    for _ in range(_REPEATS):
        before = os.times()
        subprocess.run(command, check=True, capture_output=True, env={**os.environ, **environment})
        after = os.times()
        tries.append(after.children_user + after.children_system - before.children_user - before.children_system)
    return min(tries)


def report(name: str, seconds: float, wanted: float) -> None:
    """Print one line of the result."""
    print(f"\n{name:44} {seconds:6.2f} s of CPU  (wanted: {wanted:g} s)", end="")  # noqa: T201


def test_short_commands(tmp_path: Path) -> None:
    """Help, completion, the API, and ten seconds simulated."""
    report("python -c pass", cpu_sec([sys.executable, "-c", "pass"]), 0.05)
    report("dcmg --help", cpu_sec([*DCMG, "--help"]), 0.3)
    words = {"_DCMG_COMPLETE": "complete_bash", "COMP_WORDS": "dcmg s", "COMP_CWORD": "1"}
    report("completion of a word", cpu_sec(DCMG, **words), 0.3)
    report("import dcmg", cpu_sec([sys.executable, "-c", "import dcmg"]), 0.5)
    simulate = [*DCMG, "simulate", "gallo_six_dgu", "--no-plots"]
    took = []
    for number in range(_REPEATS):
        before = os.times()
        subprocess.run([*simulate, "--out", str(tmp_path / str(number))], check=True, capture_output=True)
        after = os.times()
        took.append(after.children_user + after.children_system - before.children_user - before.children_system)
    report("dcmg simulate gallo_six_dgu --no-plots", min(took), 1.0)


def test_an_attack_by_hand(tmp_path: Path) -> None:
    """From the order to the attacker's answer, in a run that goes on."""
    with choose_domain() as free:
        domain = ["--domain", str(free)]  # other runs may be going on
    run = [*DCMG, "run", "gallo_six_dgu", "--pacing", "realtime", "--duration", "120", "--composed", "--no-plots"]
    with subprocess.Popen([*run, *domain, "--out", str(tmp_path / "run")], stderr=subprocess.DEVNULL) as process:
        try:
            listed = [*DCMG, "attack", "list", *domain]
            while subprocess.run(listed, capture_output=True, check=False).returncode:
                assert process.poll() is None
                time.sleep(0.2)  # the pace of polling, not a wait
            report(
                "dcmg attack start", cpu_sec([*DCMG, "attack", "start", "bias", "1-2", "--bias", "0", "1", "0"]), 0.6
            )
        finally:
            process.terminate()


def test_a_recording_through_an_observer() -> None:
    """Samples per second of CPU: a whole recording at once, and step by step."""
    rng = np.random.default_rng(1)
    x = np.zeros((200_000, 3))
    for step in range(len(x) - 1):
        x[step + 1] = 0.8 * x[step] + [rng.uniform(-1.0, 1.0), 0.1 * x[step, 0], 0.1 * x[step, 1]]
    observer = dcmg.design(y=x[:200], sampling_period_sec=0.01).observer
    assert observer is not None
    begin = time.process_time()
    observer.run(None, x)
    at_once = len(x) / (time.process_time() - begin)
    begin, state = time.process_time(), observer.init([], x[0].tolist())
    for row in x[:50_000].tolist():
        state, _ = observer.step(state, [], row)
    stepped = 50_000 / (time.process_time() - begin)
    print(f"\nobserver.run: {at_once / 1e6:.2f} M samples/s (wanted: 1), {at_once / stepped:.1f} x stepping", end="")  # noqa: T201
