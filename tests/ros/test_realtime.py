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
