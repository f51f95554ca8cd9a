"""What of the largest hidden damage is left to an attacker whom the combined monitor watches."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from bags.runs.avoided import compare_response
from bags.watch.scenarios import load_scenario
from dcmg.papers.check import Check
from dcmg.shipped import scenario_path
from dgu_sim.stealthy_damage import Goal, Limits, largest_damage, responses_of, stealthy_attacks

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

START_SEC, HORIZON_SEC, RISE_SEC = 20.0, 20.0, 5.0
RANGES = Limits(load_a=0.4, load_rate_a=0.4, reference_v=0.1, reference_rate_v=0.1)  # what the scenario allows inputs
SHARES = (1.0, 0.5, 0.2, 0.1, 0.05)


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchedDamage:
    """The worst attack within a share of the monitors' ranges, watched by them.

    Attributes:
        goal: what it makes large.
        share: of the ranges that it uses.
        value: its damage when nobody acts [V], or [A/A].
        accused_sec: time of the first accusation from its start on [s]; NaN: nobody is ever accused.
        links: how many links are accused.
    """

    goal: Goal
    share: float
    value: float
    accused_sec: float
    links: int


def run(seed: int, shares: Sequence[float] = SHARES, horizon_sec: float = HORIZON_SEC) -> list[WatchedDamage]:
    """Let the combined monitor watch the worst attacks of both goals within shares of its ranges."""
    path = scenario_path("gallo_six_dgu_combined")
    responses = responses_of(load_scenario(path, [f"seed={seed}"]), START_SEC, horizon_sec, RISE_SEC)
    found = []
    for goal, share in product(Goal, shares):
        limits = Limits(
            load_a=share * RANGES.load_a,
            load_rate_a=share * RANGES.load_rate_a,
            reference_v=share * RANGES.reference_v,
            reference_rate_v=share * RANGES.reference_rate_v,
        )
        damage = largest_damage(responses, limits, goal)
        attacks = f"attacks={stealthy_attacks(damage, START_SEC)}"
        scenario = load_scenario(path, [f"seed={seed}", f"duration_sec={START_SEC + horizon_sec}", attacks])
        accused = compare_response(scenario).accused
        first = accused[0].step * scenario.sampling_period_sec - START_SEC if accused else np.nan
        found.append(WatchedDamage(goal=goal, share=share, value=damage.value, accused_sec=first, links=len(accused)))
    return found


def checks(watched: Sequence[WatchedDamage]) -> list[Check]:
    """The whole ranges are noticed, and the smallest share is not."""
    found = []
    for goal in Goal:
        ours = [one for one in watched if one.goal is goal]
        largest, smallest = max(ours, key=lambda one: one.share), min(ours, key=lambda one: one.share)
        name = f"{goal}, {smallest.share:g} of the ranges: accused links"
        found += [
            Check(name=f"{goal}, whole ranges: noticed", value=float(largest.links > 0), expected=1.0, tolerance=0.0),
            Check(name=name, value=smallest.links, expected=0.0, tolerance=0.0),
        ]
    return found


def notes(watched: Sequence[WatchedDamage]) -> list[str]:
    """Damage and first accusation of each attack."""
    head = "| goal | share of the ranges | damage if nobody acts | first accusation | links accused |"
    lines = [head, "|---|---|---|---|---|"]
    for one in watched:
        unit = "V" if one.goal is Goal.MEAN_VOLTAGE else "A/A"
        when = "none" if np.isnan(one.accused_sec) else f"after {one.accused_sec:.2f} s"
        lines.append(f"| {one.goal} | {one.share:g} | {one.value:.3g} {unit} | {when} | {one.links} |")
    return lines


def plot(watched: Sequence[WatchedDamage], out_dir: Path) -> list[Path]:
    """Draw how long each attack stays unnoticed."""
    out_dir.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(6, 3.5), layout="constrained")
    axes = figure.subplots()
    for goal in Goal:
        ours = [one for one in watched if one.goal is goal]
        times = [HORIZON_SEC if np.isnan(one.accused_sec) else one.accused_sec for one in ours]
        axes.plot([one.share for one in ours], times, "o-", label=str(goal))
    axes.set_xscale("log")
    axes.set_xlabel("share of the plausible ranges that the attack uses")
    axes.set_ylabel("unnoticed for [s]")
    axes.legend()
    path = out_dir / "damage_combined.png"
    figure.savefig(path, dpi=150)
    return [path]
