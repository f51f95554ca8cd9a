"""Realtime pacing."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

from bags.runs.reader import read_run

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


@pytest.mark.timeout(180)
def test_nothing_is_lost_in_a_minute_at_100_hz(dcmg: Callable[..., Any], long_scenario: Path, tmp_path: Path) -> None:
    """Sixty seconds of realtime in fifteen processes: every published message is in the bag."""
    finished = dcmg(
        "run",
        long_scenario,
        "--duration",
        "60",
        "--pacing",
        "realtime",
        "--no-plots",
        "--json",
        "--out",
        tmp_path / "run",
        timeout_sec=150.0,
    )
    assert finished.code == 0, finished.err  # a lost message is an error
    assert json.loads(finished.out)["steps"] == 6000
    assert read_run(tmp_path / "run" / "bag").steps == 6000


def test_the_length_that_was_set_holds_in_real_time(dcmg: Callable[..., Any], tmp_path: Path) -> None:
    """Without --duration a realtime run goes on until Ctrl-C, unless --set says how long."""
    words = ("--pacing", "realtime", "--set", "duration_sec=0.5", "--composed", "--no-plots", "--out", tmp_path / "run")
    finished = dcmg("run", "isolated_dgu_1", *words)
    assert finished.code == 0, finished.err
    assert read_run(tmp_path / "run" / "bag").steps == 50
