"""What it costs to learn from noisy data: three sources for one and the same design, on the same data and noise.

Every observer is designed by the same code from a history: a noise-free one of the true plant (**model-based**: on
exact data the designs equal the papers' model-based ones, as tests show), the noisy one itself (**data-driven**), or a
noise-free one simulated from the model that least squares find in the noisy one (**identification-based**). All then
watch the same noisy outputs of the true plant. Only where the design comes from differs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from dcmg.papers.check import Check
from dcmg.papers.dduio import interval
from dcmg.papers.turan_2021 import DGUS, T_S
from dgu_sim.matrices import continuous, discretise
from monitor import delayed, input_reconstruction, observers
from monitor.baselines.identify import identified
from monitor.delayed import ConstantInput
from monitor.history import Experiment, History
from monitor.observers import LinearObserver

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from monitor.observers import Observer

SOURCES = ("model-based", "data-driven", "identification-based")
NOISE_STD = (1e-3, 1e-2)
SAMPLES = 100  # in every history
STEPS, SETTLED = 400, 100
RUNS = 40
SLOW_RUNS = 10  # of problems whose design solves LMIs
MEAN = np.array([11.0, 50.0])  # T's offline inputs, + U(-1, 1)^2
ONLINE = np.array([9.0, 47.0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """One thing to estimate.

    Attributes:
        name: for the table.
        outputs: how many of (V, I_t, v) are sent.
        measure: name and unit of the error.
        design: observer from a history, None when refused, and its lag.
        error: (true states, true inputs, estimates, residuals, observer), rows aligned, to one number.
        learned: how a model is identified from the noisy history, and simulated into a history without noise.
        slow: the design solves LMIs.
    """

    name: str
    outputs: int
    measure: str
    design: Callable[[History], Observer | None]
    error: Callable[[_Online], float]
    learned: Callable[[History, np.random.Generator], History]
    slow: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class _Online:
    """One run of an observer on the true plant, settled, rows aligned."""

    x: NDArray[np.float64]
    d: NDArray[np.float64]
    estimate: NDArray[np.float64]
    residual: NDArray[np.float64]
    observer: LinearObserver


@dataclass(frozen=True, slots=True, kw_only=True)
class GapResult:
    """Errors of all sources.

    Attributes:
        seed: of everything random.
        errors: for each problem (noise levels, sources, runs); NaN where a design was refused or was not run.
    """

    seed: int
    errors: Mapping[str, NDArray[np.float64]]


def run(seed: int = 0, runs: int = RUNS, slow_runs: int = SLOW_RUNS) -> GapResult:
    """Design from three sources and measure, `runs` times for every problem and noise level."""
    errors = {}
    for number, problem in enumerate(PROBLEMS):
        count = min(runs, slow_runs) if problem.slow else runs
        found = np.full((len(NOISE_STD), len(SOURCES), runs), np.nan)
        for level, std in enumerate(NOISE_STD):
            for trial in range(count):
                generator = np.random.default_rng((seed, number, level, trial))
                noisy, exact = _record(problem.outputs, std, generator), _record(problem.outputs, 0.0, generator)
                sources = (exact, noisy, problem.learned(noisy, generator))
                online = int(generator.integers(2**31))
                for source, history in enumerate(sources):
                    found[level, source, trial] = _measured(problem, history, std, np.random.default_rng(online))
        errors[problem.name] = found
    return GapResult(seed=seed, errors=errors)


def checks(result: GapResult) -> list[Check]:
    """Where unknown inputs are cancelled, knowing the model is never worse, up to the spread of the runs.

    For V only a design minimises a worst case, not the mean error; and least squares on noisy records shrink the gains,
    which the noise of the run rewards: in both the model may well lose.
    """
    found = []
    for problem in PROBLEMS:
        errors = result.errors[problem.name]
        for level, std in enumerate(NOISE_STD):
            model, data = errors[level, 0], errors[level, 1]
            if problem.slow or "least squares" in problem.name or not np.isfinite(data).all():
                continue
            mean, low, high = interval(data)
            behind = max(float(np.mean(model)) / mean - 1.0, 0.0)
            name = f"{problem.name}, noise {std:g}: model-based behind data-driven"
            found.append(Check(name=name, value=behind, expected=0.0, tolerance=(high - low) / mean))
    return found


def notes(result: GapResult) -> list[str]:
    """The table of the docs: mean error with its 95 % interval, and data-driven over identification, run by run."""
    lines = [
        f"{SAMPLES} samples, {RUNS} runs ({SLOW_RUNS} for V only); mean error with its 95 % bootstrap interval.",
        "",
        "| estimated | noise | " + " | ".join(SOURCES) + " | data-driven / identification |",
        "|" + "---|" * (len(SOURCES) + 3),
    ]
    for problem in PROBLEMS:
        errors = result.errors[problem.name]
        for level, std in enumerate(NOISE_STD):
            tried = SLOW_RUNS if problem.slow else errors.shape[2]
            cells = [_cell(errors[level, source], tried) for source in range(len(SOURCES))]
            both = np.isfinite(errors[level, 1:]).all(axis=0)
            paired = _ratio(errors[level, 1, both] / errors[level, 2, both])
            lines.append(f"| {problem.name}, {problem.measure} | {std:g} | " + " | ".join([*cells, paired]) + " |")
    return lines


def plot(result: GapResult, out_dir: Path) -> list[Path]:
    """Mean and interval of every source, one panel a problem."""
    out_dir.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(3.0 * len(PROBLEMS), 3.6), layout="constrained")
    for axes, problem in zip(figure.subplots(1, len(PROBLEMS)), PROBLEMS, strict=True):
        for source, name in enumerate(SOURCES):
            runs = [_known(result.errors[problem.name][level, source]) for level in range(len(NOISE_STD))]
            designed = [level for level, values in enumerate(runs) if values.size]
            bars = np.array([interval(runs[level]) for level in designed]).reshape(-1, 3)
            places = np.array(designed) + 0.15 * (source - 1)
            axes.errorbar(places, bars[:, 0], yerr=np.abs(bars[:, 1:] - bars[:, :1]).T, fmt="o", capsize=3, label=name)
        axes.set_yscale("log")
        axes.set_title(problem.name, fontsize=9)
        axes.set_ylabel(problem.measure, fontsize=8)
        axes.set_xticks(range(len(NOISE_STD)), [f"{std:g}" for std in NOISE_STD])
        axes.set_xlabel("noise")
    figure.axes[0].legend(fontsize=7)
    path = out_dir / "data_gap.png"
    figure.savefig(path, dpi=90)
    return [path]


def _record(outputs: int, std: float, generator: np.random.Generator) -> History:
    """T's offline experiment on DGU 1 with noise on states and inputs; y = C x as recorded."""
    A, E = discretise(*continuous(DGUS[0]), T_S)
    return _simulated(A, E, MEAN + generator.uniform(-1.0, 1.0, (SAMPLES, 2)), outputs, (std, generator))


def _simulated(
    A: NDArray[np.float64],
    E: NDArray[np.float64],
    d: NDArray[np.float64],
    outputs: int,
    noise: tuple[float, np.random.Generator],
) -> History:
    """Noise on states and inputs; y = C x as recorded."""
    std, generator = noise
    rows = [generator.uniform(-1.0, 1.0, len(A))]
    for one in d[:-1]:
        rows.append(A @ rows[-1] + E @ one)
    x = np.array(rows) + std * generator.standard_normal((len(d), len(A)))
    applied = d + std * generator.standard_normal(d.shape)
    return History((Experiment(np.empty((len(d), 0)), x[:, :outputs], x, T_S, applied),), T_S, comparable=True)


def _from_states(history: History, generator: np.random.Generator) -> History:
    """Identify A and E from x (the inputs are unknown), and simulate that model without noise, inputs as large."""
    model, (record,) = identified(history, 2), history.experiments
    d = generator.uniform(-1.0, 1.0, (SAMPLES, 2))
    size = np.std((record.x[1:] - record.x[:-1] @ model.A.T) @ model.E, axis=0) / np.std(d, axis=0)
    return _simulated(model.A, model.E * size, d, history.outputs, (0.0, generator))


def _from_outputs(history: History, generator: np.random.Generator) -> History:
    """Identify y_t+1 from past y and d by least squares (ARX, as many lags as V and I_t need), and simulate it."""
    (record,) = history.experiments
    lags = 1 if history.outputs == history.states else 2
    y, d = record.y, record.d
    regressors = np.hstack([signal[lag : len(y) - lags + lag] for lag in range(lags) for signal in (y, d)])
    theta = np.linalg.lstsq(regressors, y[lags:], rcond=None)[0]
    inputs = MEAN + generator.uniform(-1.0, 1.0, (SAMPLES, 2))
    outputs = list(y[:lags])
    for step in range(SAMPLES - lags):
        past = [signal for lag in range(lags) for signal in (outputs[step + lag], inputs[step + lag])]
        outputs.append(np.concatenate(past) @ theta)
    none = np.empty((SAMPLES, 0))
    return History((Experiment(none, np.array(outputs), none, T_S, inputs),), T_S, comparable=True)


def _measured(problem: Problem, history: History, std: float, generator: np.random.Generator) -> float:
    """Design, watch the true plant, and measure; NaN when refused."""
    observer = problem.design(history)
    if observer is None:
        return float("nan")
    A, E = discretise(*continuous(DGUS[0]), T_S)
    d = ONLINE + generator.uniform(-1.0, 1.0, (STEPS, 2))
    rows = [np.linalg.solve(np.eye(3) - A, E @ ONLINE)]
    for one in d[:-1]:
        rows.append(A @ rows[-1] + E @ one)
    x = np.array(rows)
    y = x[:, : problem.outputs] + std * generator.standard_normal((STEPS, problem.outputs))
    constant = isinstance(observer, ConstantInput)
    inner = observer.inner if isinstance(observer, ConstantInput) else observer
    assert isinstance(inner, LinearObserver)  # noqa: S101 - every design here is one
    v = np.hstack([np.ones((STEPS, 1)), y]) if constant else y
    state, found = inner.Z @ v[0], []
    whole = np.block([[inner.M, inner.D], [inner.H, inner.J], [inner.A, inner.B]])
    for sample in v:
        out = whole @ np.concatenate([state, sample])
        found.append(out[: len(whole) - inner.order])
        state = out[len(whole) - inner.order :]
    estimate, residual = np.split(np.array(found)[SETTLED:], [inner.states], axis=1)
    at = slice(SETTLED - inner.lag, STEPS - inner.lag)
    return problem.error(_Online(x=x[at], d=d[at], estimate=estimate, residual=residual, observer=inner))


def _bias_lost(online: _Online) -> float:
    """Root mean square residual over the largest gain of a constant bias: what is lost in noise and design error."""
    one = online.observer
    gain = one.J + one.H @ np.linalg.solve(np.eye(one.order) - one.A, one.B)
    return float(np.sqrt(np.mean(np.sum(online.residual**2, axis=1))) / np.linalg.norm(gain, 2))


def _state_error(online: _Online) -> float:
    return float(np.sqrt(np.mean(np.sum((online.estimate - online.x) ** 2, axis=1))))


def _hidden_error(online: _Online) -> float:
    return float(np.sqrt(np.mean((online.estimate[:, 2] - online.x[:, 2]) ** 2)))


def _input_error(online: _Online) -> float:
    return float(np.sqrt(np.mean(np.sum((online.estimate - online.d) ** 2, axis=1))))


def _full_order(history: History) -> Observer | None:
    return observers.design("full_order", history, {"unknown_inputs": 2}).observer


def _delayed(history: History) -> Observer | None:
    return delayed.design(history, {"unknown_inputs": 2, "delay": 1}).observer


def _uie(fit: str) -> Callable[[History], Observer | None]:
    def make(history: History) -> Observer | None:
        record = input_reconstruction.applied_as_inputs(history)
        return input_reconstruction.design("cl_uie", record, {"future": 2, "order": 3, "fit": fit}).observer

    return make


PROBLEMS = (
    Problem(
        name="UIO, y = x",
        outputs=3,
        measure="bias lost [units of y]",
        design=_full_order,
        error=_bias_lost,
        learned=_from_states,
    ),
    Problem(
        name="delayed 1, y = (V, I_t)",
        outputs=2,
        measure="error of v [V s]",
        design=_delayed,
        error=_hidden_error,
        learned=_from_states,
    ),
    Problem(
        name="delayed 1, y = V",
        outputs=1,
        measure="error of x",
        design=_delayed,
        error=_state_error,
        learned=_from_states,
        slow=True,
    ),
    *(
        Problem(
            name=f"cl-UIE {fit.replace('_', ' ')}, {sent}",
            outputs=outputs,
            measure="error of d [A, V]",
            design=_uie(fit),
            error=_input_error,
            learned=_from_outputs,
        )
        for fit in ("truncated", "least_squares")
        for sent, outputs in (("y = x", 3), ("y = (V, I_t)", 2))
    ),
)


def _known(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return values[np.isfinite(values)]


def _ratio(values: NDArray[np.float64]) -> str:
    """Geometric mean and interval."""
    if not values.size:
        return "-"
    mean, low, high = np.exp(np.array(interval(np.log(values))))
    return f"{mean:.3g} ({low:.3g}, {high:.3g})"


def _cell(values: NDArray[np.float64], tried: int) -> str:
    """Mean (interval), and how many of the designs that were tried were refused."""
    known = _known(values)
    if not known.size:
        return "all refused"
    mean, low, high = interval(known)
    refused = f"; {tried - known.size} of {tried} refused" if known.size < tried else ""
    return f"{mean:.3g} ({low:.3g}, {high:.3g}){refused}"
