"""Observers around an operating point, one step late, over ROS."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bags.runs.reader import read_run
from bags.runs.replay import replay
from dgu_sim.grid import Link

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


def test_delayed_monitors_over_ros_are_those_without(dcmg: Callable[..., Any], tmp_path: Path) -> None:
    """V only and everything: the run, the simulation and the replay conclude the same bits from the same samples."""
    detector = "monitor.detector.options={settle_sec: 0.1, calibrate_sec: 0.3}"
    runs = []
    for command, *options in (("run", "--composed"), ("simulate",)):
        out = tmp_path / command
        finished = dcmg(
            command,
            "gallo_six_dgu_voltage_only",
            *options,
            "--set",
            detector,
            "--duration",
            "1",
            "--no-plots",
            "--out",
            out,
        )
        assert finished.code == 0, finished.err
        runs.append(read_run(out / "bag"))
    for other in (runs[1], replay(runs[0])):
        for name in ("estimate", "residual", "threshold", "phase", "alarm"):
            assert getattr(other, name).tobytes() == getattr(runs[0], name).tobytes(), name
    assert runs[0].designs == runs[1].designs
    voltage_only = runs[0].links.index(Link(3, 1))
    assert np.isfinite(runs[0].residual[:, voltage_only]).all(axis=0).tolist() == [True, False, False]
    assert runs[0].designs[Link(3, 1)].lag == 1
