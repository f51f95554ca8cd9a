"""Equal biases on every link of the jointly integrated grid whose loads are drawn anew within +-1 A each sample."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from bags.runs.following import follow_many
from bags.watch.scenarios import load_scenario
from dcmg.papers.check import Check
from dcmg.shipped import scenario_path
from monitor.measures import Measured, roc

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

START_STEP, SETTLED = 1000, 50
SIZES = (0.1, 0.01, 0.003)  # of the bias on V [V], I_t [A] and v [V s]
WITHIN = 3  # samples from the attack's first one on
HISTORIES = {
    "held experiment": ("history.plant=own",),
    "joint experiment": (
        "history.plant=joint",
        "history.samples=400",
        "monitor.observer.options={unknown_inputs: 2}",
    ),
}
_CURVE = 400  # points of a drawn curve


@dataclass(frozen=True, slots=True, kw_only=True)
class Roc:
    """Scores of one DGU's outputs under one design; a score is the largest |r_i| / mean |r_i| without attack.

    Attributes:
        history: what the monitors learned from.
        size: of the bias on V [V], I_t [A] and v [V s].
        source: the watched DGU.
        clean: largest score of three samples in a row without attack, shape (runs, windows).
        attacked: largest score of the first three samples of the attack, shape (runs,).
    """

    history: str
    size: float
    source: int
    clean: NDArray[np.float64]
    attacked: NDArray[np.float64]

    def area(self, seed: int = 0) -> Measured:
        """P(a score under attack exceeds one without), ties half, with its interval by bootstrap over the runs."""
        scores = np.column_stack([self.clean, self.attacked])
        under = np.zeros(scores.shape, dtype=np.bool_)
        under[:, -1] = True
        found = roc(scores, under, ~under, block_steps=1, seed=seed)
        assert found is not None  # noqa: S101 - there are scores of both kinds
        return found.area

    def seen_at(self, rate: float) -> float:
        """Share of attacks seen within three samples when a share `rate` of clean three-sample windows alarms."""
        return float((self.attacked > np.quantile(self.clean, 1.0 - rate)).mean())


def run(seed: int, runs: int = 100, sizes: Sequence[float] = SIZES) -> list[Roc]:
    """Watch runs that end under attack on every link; one ROC for each history, size and DGU, but for refused ones."""
    found: list[Roc] = []
    for (history, changes), size in product(HISTORIES.items(), sizes):
        links = ", ".join(str(link) for link in load_scenario(scenario_path("gallo_six_dgu_joint")).links)
        attack = f"{{kind: bias, links: [{links}], start_sec: {START_STEP * 0.01}, bias: [{size}, {size}, {size}]}}"
        duration = f"duration_sec={(START_STEP + WITHIN) * 0.01}"
        scenario = load_scenario(
            scenario_path("gallo_six_dgu_joint"), [*changes, f"attacks=[{attack}]", duration, f"seed={seed}"]
        )
        parts = [part.links.residual for part in follow_many(scenario, range(seed + 1, seed + 1 + runs))]
        residual = np.abs(np.concatenate(parts))
        for source in scenario.grid.dgus:
            place = next(p for p, link in enumerate(scenario.links) if link.source == source)
            if np.isfinite(residual[SETTLED:, :, place]).all():
                found.append(_roc(history, size, source, residual[:, :, place]))
    return found


def _roc(history: str, size: float, source: int, magnitude: NDArray[np.float64]) -> Roc:
    clean, attacked = magnitude[SETTLED:START_STEP], magnitude[START_STEP : START_STEP + WITHIN]
    weights = clean.mean(axis=(0, 1))
    windows = (clean / weights).max(axis=2)
    whole = len(windows) // WITHIN * WITHIN
    three = windows[:whole].reshape(-1, WITHIN, windows.shape[1]).max(axis=1)
    return Roc(history=history, size=size, source=source, clean=three.T, attacked=(attacked / weights).max(axis=(0, 2)))


def checks(curves: Sequence[Roc]) -> list[Check]:
    """Areas with half the width of their intervals: what is expected is what the interval is centred on."""
    found = []
    for one in curves:
        area = one.area()
        low, high = _ends(area)
        name = f"{one.size:g} from DGU {one.source}, {one.history}: AUC [{low:.4f}, {high:.4f}]"
        tolerance = (high - low) / 2.0 + 1e-9
        found.append(Check(name=name, value=area.value, expected=(low + high) / 2.0, tolerance=tolerance))
    return found


def _ends(area: Measured) -> tuple[float, float]:
    return (area.value, area.value) if area.interval is None else (area.interval.low, area.interval.high)


def notes(curves: Sequence[Roc]) -> list[str]:
    """Table of areas, and of attacks seen within three samples at some false-alarm rates."""
    rates = (0.1, 0.01, 0.001)
    lines = [
        "| bias | watched | history | AUC | 95 % | " + " | ".join(f"seen at {rate:g}" for rate in rates) + " |",
        "|---|---|---|---|---|" + "---|" * len(rates),
    ]
    for one in curves:
        area = one.area()
        low, high = _ends(area)
        seen = " | ".join(f"{one.seen_at(rate):.0%}" for rate in rates)
        lines.append(
            f"| {one.size:g} | DGU {one.source} | {one.history} | {area.value:.4f} | {low:.4f} to {high:.4f} | {seen} |"
        )
    return lines


def plot(curves: Sequence[Roc], out_dir: Path) -> list[Path]:
    """Draw the curves."""
    out_dir.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(10, 6), layout="constrained")
    panels = figure.subplots(len(HISTORIES), len(SIZES), sharex=True, sharey=True)
    for row, history in zip(panels, HISTORIES, strict=True):
        for panel, size in zip(row, SIZES, strict=True):
            for one in curves:
                if (one.history, one.size) == (history, size):
                    rates = np.geomspace(1.0 / one.clean.size, 1.0, _CURVE)
                    panel.plot(rates, [one.seen_at(rate) for rate in rates], label=f"DGU {one.source}")
            panel.set_xscale("log")
            panel.set_title(f"bias {size:g}, {history}", fontsize="medium")
        row[0].set_ylabel("seen within three samples")
    for panel in panels[-1]:
        panel.set_xlabel("three-sample windows with a false alarm")
    panels[-1, 0].legend(loc="lower right", fontsize="small")
    path = out_dir / "roc_joint.png"
    figure.savefig(path, dpi=150)
    return [path]
