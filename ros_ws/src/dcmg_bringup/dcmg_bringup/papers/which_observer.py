"""Which observer when: every method of this project on one neighbour (DGU 1), under the same attacks and noise.

What is compared is what a monitor gets from a method: its needs (outputs, records, delay), which biases its residual or
its reconstructed input shows and how many steps after their start, and what it costs.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, Protocol

import numpy as np
from matplotlib.figure import Figure

from dcmg_bringup.papers.check import Check
from dcmg_bringup.papers.turan_2021 import DGUS, T_S
from dgu_sim.matrices import continuous, discretise
from monitor import delayed, input_reconstruction, observers
from monitor.history import Experiment, History

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from monitor.linear import Component, Vector
    from monitor.observers import Estimate

SAMPLES = 60
NOISE = 1e-3  # on every output sent, units of y
SETTLE, QUIET, ATTACKED = 120, 300, 80  # steps: first errors gone, calibration, under attack
MARGIN = 1.2  # threshold over the largest attack-free value
FLOOR = 1e-9  # a blind residual is rounding, which an attack may well move
RUNS = 30
SEEN_IN = 0.9  # an attack counts as seen when this share of the runs sees it
ATTACKS = {"V + 0.1": (0.1, 0.0, 0.0), "I_t + 0.5": (0.0, 0.5, 0.0), "v + 0.01": (0.0, 0.0, 0.01)}
TIMED_STEPS = 1000


class _Runs(Protocol):
    def init(self, u: Sequence[Component], y: Sequence[Component]) -> Vector: ...

    def step(self, state: Vector, u: Sequence[Component], y: Sequence[Component]) -> tuple[Vector, Estimate]: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One method.

    Attributes:
        name: the method and the outputs it gets.
        outputs: how many of (V, I_t, v) it gets.
        delay: steps by which what it tells lags.
        order: components of its state.
        blind: its residual shows no falsification whatever.
        design_sec: wall-clock time of the design.
        step_us: wall-clock time of one step in Python floats.
        detection: for each of ATTACKS the median steps from start to alarm, NaN when not seen.
    """

    name: str
    outputs: int
    delay: int
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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Method:
    """How to design a method, and whether the reconstructed input (its last component) or the residual is watched."""

    name: str
    outputs: int
    design: Callable[[History], tuple[_Runs | None, int, bool, str]]
    watched: slice | None = None


def run(seed: int = 0) -> WhichResult:
    """Design all methods from one history, calibrate, attack."""
    A, E = discretise(*continuous(DGUS[0]), T_S)
    d = np.array([11.0, 50.0]) + np.random.default_rng((seed, 0)).uniform(-1.0, 1.0, (SAMPLES, 2))
    x = _states(A, E, np.zeros(3), d)
    online = np.array([9.0, 47.0])[:, None]
    online = online + np.random.default_rng((seed, 1)).uniform(-0.5, 0.5, (SETTLE + QUIET + ATTACKED, 2, RUNS))
    truth = _states(A, E, np.repeat([[46.78], [9.0], [11.0]], RUNS, axis=1), online)
    noise = NOISE * np.random.default_rng((seed, 2)).standard_normal(truth.shape)
    return WhichResult(seed=seed, rows=tuple(_row(one, x, d, truth + noise) for one in METHODS))


def checks(result: WhichResult) -> list[Check]:
    """What the theory says beforehand: as many outputs as unknown inputs make an exact observer blind."""
    by_name = {row.name: row for row in result.rows}
    expected = {"full order, y = x": False, "delayed 1, y = x": False, "delayed 1, y = (V, I_t)": True}
    return [
        Check(name=f"blind: {name}", value=float(by_name[name].blind), expected=float(blind), tolerance=0.0)
        for name, blind in expected.items()
    ]


def plot(result: WhichResult, out_dir: Path) -> list[Path]:
    """Draw steps to detection for every attack and the time of one step."""
    out_dir.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(11.0, 5.0), layout="constrained")
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
    path = out_dir / "which_observer.png"
    figure.savefig(path, dpi=130)
    return [path]


def table(result: WhichResult) -> str:
    """Markdown table of the rows, as in the docs."""
    head = "| method | outputs | delay | order | design s | step us | " + " | ".join(ATTACKS) + " |"
    lines = [head, "|" + "---|" * (6 + len(ATTACKS))]
    for row in result.rows:
        seen = ["not seen" if np.isnan(one) else f"{one:.0f}" for one in row.detection]
        cells = [row.name + (" (blind)" if row.blind else ""), str(row.outputs), str(row.delay), str(row.order)]
        lines.append("| " + " | ".join([*cells, f"{row.design_sec:.2f}", f"{row.step_us:.0f}", *seen]) + " |")
    return "\n".join(lines)


def _states(
    A: NDArray[np.float64], E: NDArray[np.float64], start: NDArray[np.float64], d: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(steps, 3[, runs]) states."""
    rows = [start]
    for one in d[:-1]:
        rows.append(A @ rows[-1] + E @ one)
    return np.array(rows)


def _row(method: _Method, x: NDArray[np.float64], d: NDArray[np.float64], received: NDArray[np.float64]) -> Row:
    """Design, time and attack one method."""
    sent = method.outputs
    history = _history(method, x, d)
    began = perf_counter()
    observer, delay, blind, verdict = method.design(history)
    design_sec = perf_counter() - began
    if observer is None:
        raise TypeError(f"{method.name}: {verdict}")
    state = observer.init((), tuple(received[0, :sent]))
    order = len(state)
    watched = method.watched
    quiet, armed = [], state
    for step, y in enumerate(received[: SETTLE + QUIET]):
        armed, output = observer.step(armed, (), tuple(y[:sent]))
        if step >= SETTLE:
            quiet.append(_watch(output, watched, received.shape[2]))
    middle = np.mean(quiet, axis=(0, 2))[:, None]  # the plant's own level of what is watched
    threshold = np.maximum(MARGIN * np.max(np.abs(np.array(quiet) - middle), axis=(0, 2))[:, None], FLOOR)
    detection = tuple(
        _detect(
            observer,
            armed,
            received[SETTLE + QUIET :, :sent] + np.array(bias)[:sent, None],
            method,
            (middle, threshold),
        )
        for bias in ATTACKS.values()
    )
    return Row(
        name=method.name,
        outputs=sent,
        delay=delay,
        order=order,
        blind=blind,
        design_sec=design_sec,
        step_us=_time_of_step(observer, received[:, :sent, 0]),
        detection=detection,
    )


def _history(method: _Method, x: NDArray[np.float64], d: NDArray[np.float64]) -> History:
    """The record: states for observers, the applied inputs for input reconstruction."""
    y = x[:, : method.outputs]
    if method.name.startswith("cl-UIE"):
        return History((Experiment(d, y, np.empty((len(d), 0))),), T_S)
    return History((Experiment(np.empty((len(x), 0)), y, x),), T_S)


def _watch(output: Estimate, watched: slice | None, runs: int) -> NDArray[np.float64]:
    """What the detector sees, (components, runs)."""
    vector = output.residual if watched is None else output.estimate[watched]
    return np.array([np.broadcast_to(one, (runs,)) for one in vector])


def _detect(
    observer: _Runs,
    state: Vector,
    received: NDArray[np.float64],
    method: _Method,
    calibrated: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> float:
    """Median steps to the first alarm, NaN when fewer than nine in ten runs see it."""
    middle, threshold = calibrated
    first = np.full(RUNS, np.nan)
    for step, y in enumerate(received):
        state, output = observer.step(state, (), tuple(y))
        alarm = np.any(np.abs(_watch(output, method.watched, RUNS) - middle) > threshold, axis=0)
        first = np.where(np.isnan(first) & alarm, step, first)
    return float(np.nanmedian(first)) if np.mean(np.isfinite(first)) >= SEEN_IN else float("nan")


def _time_of_step(observer: _Runs, y: NDArray[np.float64]) -> float:
    """Best of five mean times of a step in Python floats [us]."""
    samples = [tuple(float(one) for one in row) for row in y]
    best = np.inf
    for _ in range(5):
        state = observer.init((), samples[0])
        began = perf_counter()
        for number in range(TIMED_STEPS // 5):
            state, _ = observer.step(state, (), samples[number])
        best = min(best, (perf_counter() - began) / (TIMED_STEPS // 5))
    return 1e6 * best


def _full(kind: str) -> Callable[[History], tuple[_Runs | None, int, bool, str]]:
    def make(history: History) -> tuple[_Runs | None, int, bool, str]:
        made = observers.design(kind, history, {"allow_blind": True})
        residual = made.certificate.residual
        return made.observer, 0, residual is not None and residual.blind, made.verdict

    return make


def _delayed(
    options: dict[str, object], *, inputs: bool = False
) -> Callable[[History], tuple[_Runs | None, int, bool, str]]:
    def make(history: History) -> tuple[_Runs | None, int, bool, str]:
        made = delayed.design(history, {"unknown_inputs": 2, **options})
        residual, guarantee = made.certificate.residual, made.guarantee
        lag = 0 if guarantee is None else (guarantee.delay if inputs else guarantee.lag)
        blind = not inputs and residual is not None and residual.blind
        return (made.input_observer if inputs else made.observer), lag, blind, made.verdict

    return make


def _uie(history: History) -> tuple[_Runs | None, int, bool, str]:
    made = input_reconstruction.design("cl_uie", history, {"past": 5, "future": 2})
    residual = made.certificate.residual
    return made.observer, made.report.delay, residual is not None and residual.blind, made.verdict


METHODS = (
    _Method(name="full order, y = x", outputs=3, design=_full("full_order")),
    _Method(name="reduced order, y = (V, I_t)", outputs=2, design=_full("reduced_order")),
    _Method(name="delayed 1, y = x", outputs=3, design=_delayed({"delay": 1})),
    _Method(name="delayed 1, y = (V, I_t)", outputs=2, design=_delayed({"delay": 1})),
    _Method(
        name="delayed 1 inputs, y = (V, I_t)",
        outputs=2,
        design=_delayed({"delay": 1}, inputs=True),
        watched=slice(None),
    ),
    _Method(name="delayed 2, y = V", outputs=1, design=_delayed({"delay": 2})),
    _Method(
        name="attack on V, delayed 1, y = x",
        outputs=3,
        design=_delayed({"delay": 1, "attacked": (0,), "goal": "exact"}, inputs=True),
        watched=slice(-1, None),
    ),
    _Method(name="cl-UIE residual, y = x", outputs=3, design=_uie),
    _Method(name="cl-UIE inputs, y = x", outputs=3, design=_uie, watched=slice(None)),
)
