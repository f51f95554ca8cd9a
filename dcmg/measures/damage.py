"""The largest damage of attacks that leave no residual, within what is plausible, and the run that shows it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from bags.runs.following import follow_many
from bags.watch.scenarios import load_scenario
from dcmg.papers.check import Check
from dcmg.shipped import scenario_path
from dgu_sim.stealthy_damage import Goal, Limits, largest_damage, responses_of, stealthy_attacks

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from dgu_sim.stealthy_damage import Damage, Responses

START_SEC, HORIZON_SEC, RISE_SEC = 5.0, 60.0, 5.0
SILENT = 1e-9
LIMITS = {
    "tight": Limits(load_a=1.0, load_rate_a=0.1, reference_v=0.1, reference_rate_v=0.01),
    "usual": Limits(load_a=5.0, load_rate_a=1.0, reference_v=0.5, reference_rate_v=0.1),
    "loose": Limits(load_a=10.0, load_rate_a=5.0, reference_v=2.0, reference_rate_v=1.0),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """The worst attack within some limits, and the run that shows it.

    Attributes:
        limits: name of the limits.
        damage: what the linear programme says.
        overrides: what turns gallo_six_dgu into the run.
        value: damage in the run, in the units of `damage.value`.
        residual: by how much the attack changes a residual anywhere [V, A, V s].
        alarms: alarms of the monitors from the attack's start on that are not there without it.
        mean_voltage: change of the mean voltage over time, shape (steps,) [V].
        spread: spread of I_t / I^r over time, likewise.
    """

    limits: str
    damage: Damage
    overrides: tuple[str, ...]
    value: float
    residual: float
    alarms: int
    mean_voltage: NDArray[np.float64]
    spread: NDArray[np.float64]


def run(
    seed: int, horizon_sec: float = HORIZON_SEC, rise_sec: float = RISE_SEC, names: Sequence[str] = tuple(LIMITS)
) -> list[Shown]:
    """Find and show the worst attacks on gallo_six_dgu within the named limits."""
    path = scenario_path("gallo_six_dgu")
    responses = responses_of(load_scenario(path, [f"seed={seed}"]), START_SEC, horizon_sec, rise_sec)
    return [
        _shown(seed, name, responses, largest_damage(responses, LIMITS[name], goal)) for name in names for goal in Goal
    ]


def _shown(seed: int, name: str, responses: Responses, damage: Damage) -> Shown:
    path = scenario_path("gallo_six_dgu")
    duration = f"duration_sec={START_SEC + responses.horizon_sec}"
    overrides = (duration, f"seed={seed}", f"attacks={stealthy_attacks(damage, START_SEC)}")
    attacked, calm = load_scenario(path, overrides), load_scenario(path, (*overrides, "attacks=[]"))
    (bad,), (good,) = (follow_many(one, [seed], one.steps) for one in (attacked, calm))
    rated = np.array([dgu.rated_current_a for dgu in attacked.dgus])
    moved = bad.block.x[:, 0] - good.block.x[:, 0]
    mean, spread = moved[:, :, 0].mean(axis=1), np.ptp(moved[:, :, 1] / rated, axis=1)
    start = round(START_SEC / attacked.sampling_period_sec)
    return Shown(
        limits=name,
        damage=damage,
        overrides=overrides,
        value=float(abs(mean[-1]) if damage.goal is Goal.MEAN_VOLTAGE else spread[-1]),
        residual=float(np.abs(bad.links.residual[start:] - good.links.residual[start:]).max()),
        alarms=int((bad.links.alarm[start:] & ~good.links.alarm[start:]).sum()),
        mean_voltage=mean,
        spread=spread,
    )


def checks(shown: Sequence[Shown]) -> list[Check]:
    """The run does what the linear programme says, unseen."""
    found = []
    for one in shown:
        name = f"{one.limits} limits, {one.damage.goal}"
        expected = one.damage.value
        found += [
            Check(name=f"{name}: damage in the run", value=one.value, expected=expected, tolerance=0.01 * expected),
            Check(name=f"{name}: change of any residual", value=one.residual, expected=0.0, tolerance=SILENT),
            Check(name=f"{name}: alarms", value=one.alarms, expected=0.0, tolerance=0.0),
        ]
    return found


def notes(shown: Sequence[Shown]) -> list[str]:
    """The damages as a table, and one run to repeat."""
    lines = [
        "| limits: load, reference | largest mean-voltage change [V] | largest sharing spread [A/A] |",
        "|---|---|---|",
    ]
    for name, limits in LIMITS.items():
        values = [f"{one.value:.3g} ({len(one.damage.currents)} links)" for one in shown if one.limits == name]
        lines.append(f"| {name}: {limits.load_a:g} A, {limits.reference_v:g} V | {' | '.join(values)} |")
    worst = next(one for one in shown if one.limits == "usual")
    options = " ".join(f"--set '{override}'" for override in worst.overrides)
    return [*lines, "", "The run of the usual limits and the mean voltage:", f"dcmg simulate gallo_six_dgu {options}"]


def plot(shown: Sequence[Shown], out_dir: Path) -> list[Path]:
    """Draw the damages over time."""
    out_dir.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(8, 3.5), layout="constrained")
    panels = figure.subplots(1, 2)
    for one in shown:
        mean = one.damage.goal is Goal.MEAN_VOLTAGE
        series = np.abs(one.mean_voltage) if mean else one.spread
        panels[0 if mean else 1].plot(np.arange(len(series)) * 0.01, series, label=f"{one.limits} limits")
    for panel, label in zip(panels, ("|mean voltage change| [V]", "spread of I / I^r"), strict=True):
        panel.axvline(START_SEC, color="0.6", linestyle=":")
        panel.set_xlabel("t [s]")
        panel.set_ylabel(label)
    panels[0].legend()
    path = out_dir / "stealthy_damage.png"
    figure.savefig(path, dpi=150)
    return [path]
