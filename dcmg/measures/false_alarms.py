"""False alarms of the two detectors that promise something, on runs of seeds that they have never seen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import t as student_t

from bags.runs.following import follow_many
from bags.watch.scenarios import load_scenario
from dcmg.papers.check import Check
from dcmg.shipped import scenario_path
from monitor.detectors import Phase

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from dgu_sim.scenario import Scenario

NOISE = {
    "uniform": "{kind: uniform, half_width: [0.01, 0.02, 0.003]}",
    "gaussian": "{kind: gaussian, std: [0.01, 0.02, 0.003]}",
    "student": "{kind: student, scale: [0.01, 0.02, 0.003]}",
}
BOUND = [0.01, 0.02, 0.003]
COUPLINGS = ("held", "joint")
RATE = 0.01
PROMISED = 8 / 801  # 1000 samples of calibration: 200 weigh, of 800 scores the 8th largest is the threshold
MILLION = 1_000_000
_LOADS = [
    f"dgus.{place}.load=[{{kind: uniform, low_a: {mean - 1}, high_a: {mean + 1}}}]"
    for place, mean in enumerate((10, 12, 15, 13, 18, 16))
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """False alarms of one detector under one coupling and noise.

    Attributes:
        detector: its name.
        coupling: held or joint.
        noise: kind of the noise.
        rates: share of armed samples with an alarm in each run, shape (runs,).
        samples: armed samples of all runs and links.
        alarms: alarms among them.
    """

    detector: str
    coupling: str
    noise: str
    rates: NDArray[np.float64]
    samples: int
    alarms: int

    @property
    def half_width(self) -> float:
        """Half of the 95 % interval of the mean rate, by the spread over the runs."""
        runs = len(self.rates)
        return float(student_t.ppf(0.975, runs - 1) * self.rates.std(ddof=1) / np.sqrt(runs))


def scenario_of(coupling: str, noise: str, detector: str, duration_sec: float, seed: int) -> Scenario:
    """The six-DGU grid without an attack, every load drawn anew within +-1 A each sample."""
    changes = [*_LOADS, f"coupling={coupling}", f"noise={NOISE[noise]}", f"monitor.detector={detector}"]
    changes += ["attacks=[]", f"duration_sec={duration_sec}", f"seed={seed}"]
    return load_scenario(scenario_path("gallo_six_dgu"), changes)


def case_of(detector: str, scenario: Scenario, noise: str, seeds: Sequence[int]) -> Case:
    """Count the alarms of runs of some seeds; one link of each DGU, because two links carry the same sample."""
    first = {link.source: place for place, link in reversed(list(enumerate(scenario.links)))}
    links = sorted(first.values())
    armed, alarms = np.zeros(len(seeds), dtype=np.int64), np.zeros(len(seeds), dtype=np.int64)
    for watched in follow_many(scenario, seeds):
        armed += (watched.links.phase[:, :, links] == Phase.ARMED).sum(axis=(0, 2))
        alarms += watched.links.alarm[:, :, links].sum(axis=(0, 2))
    return Case(
        detector=detector,
        coupling=str(scenario.coupling),
        noise=noise,
        rates=alarms / armed,
        samples=int(armed.sum()),
        alarms=int(alarms.sum()),
    )


def coupling_floor(scenario: Scenario) -> list[float]:
    """Largest |residual| that loads within +-1 A can cause in any link where the design does not hold, 3 components.

    The observers and the grid are linear: sum over DGUs and lags of |residual after an impulse of 1 A|, plus what the
    grid's own settling leaves. 0 up to rounding with coupling `held`.
    """
    quiet = ("noise={kind: none}", "duration_sec=6", "monitor.detector={kind: fixed}")
    steady = [f"dgus.{place}.load=[{{kind: constant, current_a: {one.nominal_load}}}]" for place, one in
              enumerate(scenario.dgus)]  # fmt: skip

    def residual(*changes: str) -> NDArray[np.float64]:
        path = scenario_path("gallo_six_dgu")
        run = load_scenario(path, [*steady, f"coupling={scenario.coupling}", "attacks=[]", *quiet, *changes])
        (watched,) = follow_many(run, [run.seed], run.steps)
        return watched.links.residual[:, 0]

    calm = residual()
    floor = np.nanmax(np.abs(calm[50:]), axis=0)
    for place, one in enumerate(scenario.dgus):
        load = one.nominal_load
        impulse = f"{{kind: table, time_sec: [0, 3, 3.01], current_a: [{load}, {load + 1}, {load}]}}"
        floor = floor + np.abs(residual(f"dgus.{place}.load=[{impulse}]") - calm)[1:].sum(axis=0)
    return [float(largest) for largest in floor.max(axis=0)]


def run(seed: int, runs: int = 120, samples: int = MILLION) -> list[Case]:
    """Measure every case.

    Args:
        seed: of the histories; the runs have the seeds behind it.
        runs: how many.
        samples: armed samples of noise_bound in each of its cases.
    """
    seeds = range(seed + 1, seed + 1 + runs)
    cases = []
    for coupling in COUPLINGS:
        floor = [1e-9] * 3
        if coupling == "joint":
            floor = coupling_floor(scenario_of(coupling, "uniform", "{kind: fixed}", 1.0, seed))
        bound = f"{{kind: noise_bound, options: {{noise: {BOUND}, floor: {[1.001 * one + 1e-9 for one in floor]}}}}}"
        duration = 0.5 + 0.01 * np.ceil(samples / (6 * runs))
        scenario = scenario_of(coupling, "uniform", bound, duration, seed)
        cases.append(case_of("noise_bound", scenario, "uniform", seeds))
        for noise in NOISE:
            calibrated = f"{{kind: calibrated, options: {{rate: {RATE}}}}}"
            scenario = scenario_of(coupling, noise, calibrated, 10.5 + 20.0, seed)
            cases.append(case_of("calibrated", scenario, noise, seeds))
    return cases


def checks(cases: Sequence[Case]) -> list[Check]:
    """No alarm at all, or the promised rate within the 95 % interval."""
    found = []
    for case in cases:
        name = f"{case.detector}, {case.coupling}, {case.noise} noise: "
        if case.detector == "noise_bound":
            found.append(
                Check(name=f"{name}alarms in {case.samples} samples", value=case.alarms, expected=0, tolerance=0)
            )
        else:
            rate = float(case.rates.mean())
            found.append(Check(name=f"{name}rate", value=rate, expected=PROMISED, tolerance=case.half_width))
    return found


def plot(cases: Sequence[Case], out_dir: Path) -> list[Path]:
    """Draw the rates with their intervals."""
    out_dir.mkdir(parents=True, exist_ok=True)
    shown = [case for case in cases if case.detector == "calibrated"]
    figure = Figure(figsize=(7, 3.5), layout="constrained")
    axes = figure.subplots()
    places = range(len(shown))
    axes.errorbar(
        places, [case.rates.mean() for case in shown], [case.half_width for case in shown], fmt="o", capsize=4
    )
    axes.axhline(PROMISED, color="tab:red", label="promised")
    axes.set_xticks(places, [f"{case.coupling}\n{case.noise}" for case in shown])
    axes.set_ylabel("false alarms per sample")
    axes.set_title("calibrated: rate and 95 % interval over held-out runs")
    axes.legend()
    path = out_dir / "false_alarms.png"
    figure.savefig(path, dpi=150)
    return [path]
