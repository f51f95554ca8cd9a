"""Detectors on whole runs of the six-DGU grid: what issue 4 asks of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from bags.watch.monitors import MonitorArrays, link_monitors
from bags.watch.scenarios import load_scenario
from dgu_sim.simulate import simulate
from monitor.detectors import Phase

if TYPE_CHECKING:
    from pathlib import Path

LOADS = [
    f"dgus.{dgu}.load=[{{kind: constant, current_a: {mean}}}, {{kind: uniform, low_a: -1, high_a: 1}}]"
    for dgu, mean in enumerate((10, 12, 15, 13, 18, 16))
]
NOISE = {
    "none": "noise={kind: none}",
    "uniform": "noise={kind: uniform, half_width: [0.01, 0.02, 0.003]}",
    "gaussian": "noise={kind: gaussian, std: [0.01, 0.02, 0.003]}",
}


def _conclusions(path: Path, *overrides: str) -> MonitorArrays:
    scenario = load_scenario(path, overrides)
    monitors = link_monitors(scenario)
    (block,) = simulate(scenario, block_steps=scenario.steps)
    return monitors.run(monitors.init(), block.received[:, 0], block.delivered[:, 0])[1]


def test_every_link_is_defended_within_three_samples(scenario_path: Path) -> None:
    """(0.1, 0.1, 0.1) on any of 14 links: alarm within 3 samples, no false one in 10^5 clean ones (noise-free)."""
    pairs = ((1, 2), (1, 3), (1, 6), (2, 4), (3, 4), (4, 5), (5, 6))
    links = ", ".join(f"{a}-{b}, {b}-{a}" for a, b in pairs)
    attack = f"attacks=[{{kind: bias, links: [{links}], start_sec: 75, bias: [0.1, 0.1, 0.1]}}]"
    outputs = _conclusions(scenario_path, "duration_sec=76", attack)
    assert outputs.alarm.shape[1] == 14
    assert int((outputs.phase[:7500] == Phase.ARMED).sum()) > 100_000
    assert not outputs.alarm[:7500].any()
    assert outputs.alarm[7500:7503].any(axis=0).all()


@pytest.mark.parametrize(("coupling", "noise"), [("held", "uniform"), ("held", "gaussian"), ("joint", "none")])
def test_calibrated_rate_holds_with_random_loads(scenario_path: Path, coupling: str, noise: str) -> None:
    """Loads of +-1 A drawn anew every sample, three seeds: the rate over links lies in the 95 % interval of k/(n+1)."""
    detector = "monitor.detector={kind: calibrated, options: {rate: 0.01}}"
    rates: list[float] = []
    for seed in (1, 2, 3):
        outputs = _conclusions(
            scenario_path, *LOADS, f"coupling={coupling}", NOISE[noise], detector, f"seed={seed}", "duration_sec=40",
            "attacks=[]",
        )  # fmt: skip
        armed = outputs.phase == Phase.ARMED
        rates += (outputs.alarm.sum(axis=0) / armed.sum(axis=0)).tolist()
    assert abs(float(np.mean(rates)) - 8 / 801) < 1.96 * float(np.std(rates)) / np.sqrt(len(rates))
