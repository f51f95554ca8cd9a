"""What current biases do to the mean voltage: theory section 2."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from bags.watch.scenarios import load_scenario
from dcmg.papers.check import Check
from dcmg.shipped import scenario_path
from dgu_sim.simulate import simulate

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

START_SEC, DURATION_SEC, FROM_SEC = 5.0, 60.0, 30.0
BIASES: Mapping[str, Mapping[str, float]] = {
    "0.5 A on 1-2": {"1-2": 0.5},
    "0.5 A on 1-2, 0.2 A on 5-4": {"1-2": 0.5, "5-4": 0.2},
    "0.1 A on each of 14 links": {},
    "zero sum: 0.5 A on 1-2, -0.5 A on 5-4": {"1-2": 0.5, "5-4": -0.5},
}
_ALL = 0.1


def run(seed: int) -> dict[str, NDArray[np.float64]]:
    """Mean voltage [V] over time under each attack, shape (steps,)."""
    return {name: _mean_voltage(seed, biases) for name, biases in BIASES.items()}


def _mean_voltage(seed: int, biases: Mapping[str, float]) -> NDArray[np.float64]:
    path = scenario_path("gallo_six_dgu")
    links = {str(link): _ALL for link in load_scenario(path).links}
    attacks = ", ".join(
        f"{{kind: bias, link: {link}, start_sec: {START_SEC}, bias: [0, {current}, 0]}}"
        for link, current in (biases or links).items()
    )
    changes = [f"attacks=[{attacks}]", f"duration_sec={DURATION_SEC}", f"seed={seed}"]
    scenario = load_scenario(path, changes)
    (block,) = simulate(scenario, block_steps=scenario.steps)
    return np.asarray(block.x[:, 0, :, 0].mean(axis=1))


def checks(means: Mapping[str, NDArray[np.float64]]) -> list[Check]:
    """The ramp k_I sum(phi_I / I^r) / N within 1 %; with a zero sum the mean as it was."""
    scenario = load_scenario(scenario_path("gallo_six_dgu"))
    T_s, count = scenario.sampling_period_sec, len(scenario.dgus)
    found = []
    for name, mean in means.items():
        total = sum(BIASES[name].values()) or (0.0 if BIASES[name] else _ALL * len(scenario.links))
        start = round(FROM_SEC / T_s)
        slope = (mean[-1] - mean[start]) / ((len(mean) - 1 - start) * T_s)
        expected = scenario.secondary.gain * total / count
        if total:
            found.append(
                Check(name=f"{name}: mean voltage [V/s]", value=slope, expected=expected, tolerance=0.01 * expected)
            )
        else:
            moved = float(mean[-1]) - sum(dgu.reference_v for dgu in scenario.dgus) / count
            found.append(Check(name=f"{name}: move of the mean voltage [V]", value=moved, expected=0.0, tolerance=1e-6))
    return found


def plot(means: Mapping[str, NDArray[np.float64]], out_dir: Path) -> list[Path]:
    """Draw the mean voltages."""
    out_dir.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(7, 3.5), layout="constrained")
    axes = figure.subplots()
    for name, mean in means.items():
        axes.plot(np.arange(len(mean)) * 0.01, mean, label=name)
    axes.axvline(START_SEC, color="0.6", linestyle=":")
    axes.set_xlabel("t [s]")
    axes.set_ylabel("mean voltage [V]")
    axes.legend()
    path = out_dir / "impact.png"
    figure.savefig(path, dpi=150)
    return [path]
