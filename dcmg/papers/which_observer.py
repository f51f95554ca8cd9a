"""Which observer when: every method of this project as neighbour 2 of DGU 1 would use it, under the same attacks.

What is compared is what a monitor gets from a method: its needs (outputs, record, delay, communication), which biases
its residual or its reconstructed input shows and how many samples after their start, and what it costs. Link methods
watch DGU 1 alone; the distributed observer watches it as node 2 of the six-DGU grid.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from dcmg.papers.check import Check
from dcmg.papers.turan_2021 import DGUS, T_S
from dcmg.papers.which_methods import METHODS, Judgeable, Method
from dcmg.papers.which_team import floats_heard, record_residuals, step_time_us, team_on_grid
from dgu_sim.matrices import continuous, discretise
from monitor.errors import MonitorError
from monitor.history import Experiment, History

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from monitor.linear import Vector

SAMPLES = 60
NOISE = 1e-3  # on every output sent, units of y
SETTLE, QUIET, ATTACKED = 120, 300, 80  # steps: first errors gone, calibration, under attack
MARGIN = 1.2  # threshold over the largest attack-free value
FLOOR = 1e-9  # a blind residual is rounding, which an attack may well move
RUNS = 30
SEEN_IN = 0.9  # an attack counts as seen when this share of the runs sees it
ATTACKS = {"V + 0.1": (0.1, 0.0, 0.0), "I_t + 0.5": (0.0, 0.5, 0.0), "v + 0.01": (0.0, 0.0, 0.01)}
TIMED_STEPS = 200
FEWEST = 5  # samples from which a smallest history is searched


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One method.

    Attributes:
        name: the method and the outputs it gets.
        gives: what a monitor gets from it.
        record: what the history must hold besides y.
        fewest: samples in the shortest exact history that it accepts; 0 when that was not looked for.
        heard: numbers received in a step.
        lag: steps by which what it tells lags.
        order: components of its state.
        blind: what is watched shows no falsification whatever.
        design_sec: wall-clock time of the design.
        step_us: wall-clock time of one step in Python floats.
        detection: for each of ATTACKS the median steps from start to alarm, NaN when not seen.
    """

    name: str
    gives: str
    record: str
    fewest: int
    heard: int
    lag: int
    order: int
    blind: bool
    design_sec: float
    step_us: float
    detection: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class WhichResult:
    """The table.

    Attributes:
        seed: of everything random.
        rows: one for each method.
    """

    seed: int
    rows: tuple[Row, ...]


def run(seed: int = 0) -> WhichResult:
    """Design all methods from one history, calibrate, attack."""
    A, E = discretise(*continuous(DGUS[0]), T_S)
    d = np.array([11.0, 50.0]) + np.random.default_rng((seed, 0)).uniform(-1.0, 1.0, (SAMPLES, 2))
    x = _states(A, E, np.zeros(3), d)
    online = np.array([9.0, 47.0])[:, None]
    online = online + np.random.default_rng((seed, 1)).uniform(-0.5, 0.5, (SETTLE + QUIET + ATTACKED, 2, RUNS))
    truth = _states(A, E, np.repeat([[46.78], [9.0], [11.0]], RUNS, axis=1), online)
    received = truth + NOISE * np.random.default_rng((seed, 2)).standard_normal(truth.shape)
    rows = [_row(method, x, d, received) for method in METHODS]
    return WhichResult(seed=seed, rows=(*rows, _team_row(seed)))


def checks(result: WhichResult) -> list[Check]:
    """What the theory says beforehand: as many outputs as unknown inputs make an exact observer blind."""
    by_name = {row.name: row for row in result.rows}
    expected = {"full_order, y = x": False, "delayed 1, y = x": False, "delayed 1, y = (V, I_t)": True}
    found = [
        Check(name=f"blind: {name}", value=float(by_name[name].blind), expected=float(blind), tolerance=0.0)
        for name, blind in expected.items()
    ]
    for row in result.rows:
        if row.blind:
            seen = float(np.count_nonzero(np.isfinite(row.detection)))
            found.append(Check(name=f"attacks seen: {row.name}", value=seen, expected=0.0, tolerance=0.0))
    return found


def notes(result: WhichResult) -> list[str]:
    """The table of the docs."""
    return table(result).splitlines()


def plot(result: WhichResult, out_dir: Path) -> list[Path]:
    """Draw steps to detection for every attack, and the time of one step."""
    out_dir.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(11.0, 7.5), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(2, 1))
    rows = np.arange(len(result.rows))
    for number, attack in enumerate(ATTACKS):
        steps = np.array([row.detection[number] for row in result.rows])
        left.barh(rows + 0.25 * (number - 1), np.nan_to_num(steps + 1.0), height=0.25, label=attack)
        for row in rows[np.isnan(steps)]:
            left.text(0.05, row + 0.25 * (number - 1), "not seen", va="center", fontsize="x-small")
    left.set(yticks=rows, yticklabels=[row.name for row in result.rows], xlabel="samples until the alarm (median)")
    left.invert_yaxis()
    left.legend()
    right.barh(rows, [row.step_us for row in result.rows], color="0.6")
    right.set_xlabel("one step [us]")
    right.set_xscale("log")
    right.xaxis.set_major_formatter("{x:g}")
    right.xaxis.set_minor_formatter("")
    path = out_dir / "which_observer.png"
    figure.savefig(path, dpi=90)
    return [path]


def table(result: WhichResult) -> str:
    """Markdown table of the rows, as in the docs."""
    columns = ("method", "gives", "record", "fewest samples", "floats heard", "lag", "order", "design s", "step us")
    lines = ["| " + " | ".join([*columns, *ATTACKS]) + " |", "|" + "---|" * (len(columns) + len(ATTACKS))]
    for row in result.rows:
        seen = ["-" if np.isnan(one) else f"{one:.0f}" for one in row.detection]
        name = row.name + (" (blind)" if row.blind else "")
        needs = [row.gives, row.record, str(row.fewest or "-"), str(row.heard), str(row.lag), str(row.order)]
        lines.append("| " + " | ".join([name, *needs, f"{row.design_sec:.2g}", f"{row.step_us:.0f}", *seen]) + " |")
    return "\n".join(lines)


def _states(
    A: NDArray[np.float64], E: NDArray[np.float64], start: NDArray[np.float64], d: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(steps, 3[, runs]) states."""
    rows = [start]
    for one in d[:-1]:
        rows.append(A @ rows[-1] + E @ one)
    return np.array(rows)


def _row(method: Method, x: NDArray[np.float64], d: NDArray[np.float64], received: NDArray[np.float64]) -> Row:
    """Design, time and attack one method."""
    history = _history(method, x, d)
    began = perf_counter()
    made = method.design(history)
    design_sec = perf_counter() - began
    watched = made.watched
    if watched is None:
        raise TypeError(f"{method.name}: {made.verdict}")
    y = received[:, : method.outputs]
    order = len(watched.init(tuple(y[0])))
    armed, quiet = _run(watched, watched.init(tuple(y[0])), y[: SETTLE + QUIET])
    biases = [np.array(bias)[: method.outputs, None] for bias in ATTACKS.values()]
    attacked = np.array([_run(watched, armed, y[SETTLE + QUIET :] + bias)[1] for bias in biases])
    return Row(
        name=method.name,
        gives=method.gives,
        record=method.record,
        fewest=_fewest(method, x, d),
        heard=method.outputs,
        lag=made.lag,
        order=order,
        blind=made.blind,
        design_sec=design_sec,
        step_us=_time_of_step(watched, received[:, : method.outputs, 0]),
        detection=_detect(quiet[SETTLE:], attacked),
    )


def _team_row(seed: int) -> Row:
    """The distributed observer."""
    made, plant, design_sec = team_on_grid(seed)
    noise = (NOISE, np.random.default_rng((seed, 3)))
    quiet, attacked = record_residuals(made, plant, list(ATTACKS.values()), (QUIET, ATTACKED, RUNS), noise)
    return Row(
        name="distributed, node 2 of six",
        gives="state of the whole grid, residual",
        record="x of the grid, d not heard",
        fewest=0,
        heard=floats_heard(made),
        lag=0,
        order=len(made.gains[0].E),
        blind=False,
        design_sec=design_sec,
        step_us=step_time_us(made, TIMED_STEPS),
        detection=_detect(quiet, attacked),
    )


def _history(method: Method, x: NDArray[np.float64], d: NDArray[np.float64]) -> History:
    """The record; outputs that are not sent are left out, and so is what the method does not need."""
    states = x if "x" in method.record else np.empty((len(x), 0))
    applied = d if "d" in method.record else np.empty((len(x), 0))
    return History(
        (Experiment(np.empty((len(x), 0)), x[:, : method.outputs], states, T_S, applied),), T_S, comparable=True
    )


def _fewest(method: Method, x: NDArray[np.float64], d: NDArray[np.float64]) -> int:
    """Samples in the shortest history that is accepted, 0 when none is."""
    for samples in range(FEWEST, len(x) + 1):
        try:
            if method.design(_history(method, x[:samples], d[:samples])).watched is not None:
                return samples
        except MonitorError:
            continue  # too short to be looked at
    return 0


def _run(watched: Judgeable, state: Vector, y: NDArray[np.float64]) -> tuple[Vector, NDArray[np.float64]]:
    """Take the samples (steps, p, runs); the state and what is watched, (steps, components, runs)."""
    found = []
    for sample in y:
        state, shown = watched.step(state, tuple(sample))
        found.append([np.broadcast_to(one, sample.shape[1:]) for one in shown])
    return state, np.array(found)


def _detect(quiet: NDArray[np.float64], attacked: NDArray[np.float64]) -> tuple[float, ...]:
    """Median steps to the first alarm under each attack, NaN when fewer than nine in ten runs see it."""
    middle = np.mean(quiet, axis=(0, 2))[:, None]  # the plant's own level of what is watched
    threshold = np.maximum(MARGIN * np.max(np.abs(quiet - middle), axis=(0, 2))[:, None], FLOOR)
    medians = []
    for shown in attacked:
        alarm = np.any(np.abs(shown - middle) > threshold, axis=1)  # (steps, runs)
        first = np.where(alarm.any(axis=0), np.argmax(alarm, axis=0), np.nan)
        medians.append(float(np.nanmedian(first)) if np.mean(np.isfinite(first)) >= SEEN_IN else float("nan"))
    return tuple(medians)


def _time_of_step(watched: Judgeable, y: NDArray[np.float64]) -> float:
    """Best of five mean times of a step in Python floats [us]."""
    samples = [tuple(float(one) for one in row) for row in y[:TIMED_STEPS]]
    best = np.inf
    for _ in range(5):
        state = watched.init(samples[0])
        began = perf_counter()
        for sample in samples:
            state, _ = watched.step(state, sample)
        best = min(best, (perf_counter() - began) / len(samples))
    return 1e6 * best
