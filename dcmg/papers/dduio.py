"""Distributed data-driven UIO: the comparison of D on two masses and two springs, five nodes in a ring.

The paper's own matrices and data are not available, so its table of MSE and MAE is not claimed; what is repeated is the
comparison: the same noisy data and the same runs for every method.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from scipy.linalg import expm

from dcmg.papers.check import Check
from monitor.distributed import derivatives, design, filtered, integral, ring
from monitor.distributed.baselines import NodeModel, identification_based, jointly_identified, model_based
from monitor.distributed.regressors import differences
from monitor.history import Experiment, History

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from monitor.distributed import DistributedDesign, NodeGains, Regressors

M1, M2, K1, K2 = 1.1, 0.9, 1.5, 1.0  # [kg], [N/m]; state (x1, x1', x2, x2')
A = np.array([[0, 1, 0, 0], [-(K1 + K2) / M1, 0, K2 / M1, 0], [0, 0, 0, 1], [K2 / M2, 0, -K2 / M2, 0]])
B = np.array([[0.0, 0.0], [1.0 / M1, 0.0], [0.0, 0.0], [0.0, 1.0 / M2]])
B_W = np.array([[0.0], [0.0], [0.0], [0.5]])  # disturbance w ~ U(-1, 1)
KNOWN = ((0,), (1,), (0,), (), (1,))  # inputs known to each node
MEASURED = ((0, 3), (1, 3), (3, 2), (1, 3), (1, 3, 0))  # states measured by each node
UNKNOWN = (1, 2, 1, 2, 2)
LABELS = ("x1 [m]", "x1' [m/s]", "x2 [m]", "x2' [m/s]")
SAMPLES = 40  # T
HELD_BACK = 10  # more that only the proof of the data-driven design sees
NOISE = 0.01  # on states and derivatives of the data, standard deviation
WRONG = 0.05  # relative error of Bbar in the last method
RUNS = 60
STEP_SEC, DURATION_SEC = 0.05, 20.0
METHODS = (
    "model-based",
    "data-driven",
    "identification, one model",
    "identification, a model a node",
    "identification, Bbar to 5 %",
)
FORMS = ("central differences", "filtered, 0.3 s", "integral, 0.5 s")
PERIODS = (0.1, 0.05, 0.02)  # [s]
EXPECTED = {"lambda_min(Lap_1)": (0.382, 5e-4), "bound on chi": (2.223, 5e-4), "chi": (2.446, 5e-4)}
ABSCISSA = -0.522


@dataclass(frozen=True, slots=True, kw_only=True)
class DduioResult:
    """The comparison.

    Attributes:
        seed: of everything random.
        exact: design from data without noise.
        truth: model-based design.
        t: (steps,) time of one run [s].
        x: (steps, 4) true states of it.
        estimates: for the first three methods (steps, 5, 4).
        mse: (runs, methods) mean over time, nodes of |x - xhat|^2.
        mae: (runs, methods) the same of the absolute error per state.
        late_mae: (runs, methods) the latter over the second half of the run, when first errors have died out.
        exact_late_mae: (methods,) the same of one run designed from data without noise.
        refused: designs from data that were refused and drawn again.
        form_error: (forms, periods) mean over nodes of |H - H_true| from sampled records without noise.
    """

    seed: int
    exact: DistributedDesign
    truth: DistributedDesign
    t: NDArray[np.float64]
    x: NDArray[np.float64]
    estimates: tuple[NDArray[np.float64], ...]
    mse: NDArray[np.float64]
    mae: NDArray[np.float64]
    late_mae: NDArray[np.float64]
    exact_late_mae: NDArray[np.float64]
    refused: int
    form_error: NDArray[np.float64]


def run(seed: int = 0, runs: int = RUNS) -> DduioResult:
    """Design and run all methods on the same data, 60 times unless told otherwise."""
    truth = model_based(_models(), ring(5), {}, sampled=False)
    exact = design(_records(np.random.default_rng((seed, 0)), 0.0), ring(5), {})
    mse, mae, late = (np.empty((runs, len(METHODS))) for _ in range(3))
    refused = 0
    shown: tuple[NDArray[np.float64], tuple[NDArray[np.float64], ...]] | None = None
    for number in range(runs):
        generator = np.random.default_rng((seed, 1, number))
        designs = _designs(generator, truth)
        while designs is None:
            refused += 1
            designs = _designs(generator, truth)
        x, estimates = _online(designs, generator)
        errors = [found - x[:, None, :] for found in estimates]
        mse[number] = [np.mean(np.sum(error**2, axis=2)) for error in errors]
        mae[number] = [np.mean(np.abs(error)) for error in errors]
        late[number] = [np.mean(np.abs(error[len(error) // 2 :])) for error in errors]
        shown = shown or (x, tuple(estimates[:3]))
    shown_x, shown_estimates = shown or (np.empty((0, 4)), ())
    return DduioResult(
        seed=seed,
        exact=exact,
        truth=truth,
        t=np.arange(len(shown_x), dtype=np.float64) * STEP_SEC,
        x=shown_x,
        estimates=shown_estimates,
        mse=mse,
        mae=mae,
        late_mae=late,
        exact_late_mae=_exact_late(np.random.default_rng((seed, 3)), truth),
        refused=refused,
        form_error=_form_errors(np.random.default_rng((seed, 2)), truth),
    )


def checks(result: DduioResult) -> list[Check]:
    """The page's numbers, that exact data give the model-based design, and that its errors vanish."""
    found = {"lambda_min(Lap_1)": ring(5).grounded(0)}
    found |= {"bound on chi": result.truth.report.chi_bound or np.nan, "chi": result.truth.report.chi or np.nan}
    listed = [
        Check(name=name, value=value, expected=EXPECTED[name][0], tolerance=EXPECTED[name][1])
        for name, value in found.items()
    ]
    for name, made in (("model-based", result.truth), ("data-driven, exact data", result.exact)):
        abscissa = made.report.stability or np.nan
        listed.append(Check(name=f"abscissa, {name}", value=abscissa, expected=ABSCISSA, tolerance=5e-4))
    distance = _distance(result.exact.gains, result.truth.gains)
    listed.append(Check(name="data-driven H on exact data", value=distance, expected=0.0, tolerance=1e-8))
    last = np.max(np.abs(result.estimates[0][-1] - result.x[-1]))
    # exp(-0.522 * 20) = 2.9e-5 of first errors of order 1; the page met 9.3e-5 from its own start.
    listed.append(Check(name="model-based error after 20 s", value=float(last), expected=0.0, tolerance=1e-3))
    return listed


def interval(values: NDArray[np.float64]) -> tuple[float, float, float]:
    """Mean and its 95 % interval by the bootstrap."""
    generator = np.random.default_rng(0)
    means = np.mean(values[generator.integers(0, len(values), (2000, len(values)))], axis=1)
    return float(np.mean(values)), float(np.percentile(means, 2.5)), float(np.percentile(means, 97.5))


def notes(result: DduioResult) -> list[str]:
    """The comparison and the forms of data as tables."""
    lines = [
        "",
        f"{len(result.mse)} runs, {SAMPLES} samples with noise {NOISE} for each node; mean and 95 % interval.",
        "",
        "| method | MSE | MAE | MAE, second half | the same, exact data |",
        "|---|---|---|---|---|",
    ]
    for at, method in enumerate(METHODS):
        cells = ["{:.4f} ({:.4f}, {:.4f})".format(*interval(one[:, at])) for one in (result.mse, result.mae)]
        cells.append("{:.4f} ({:.4f}, {:.4f})".format(*interval(result.late_mae[:, at])))
        lines.append(f"| {method} | " + " | ".join(cells) + f" | {result.exact_late_mae[at]:.4f} |")
    lines += ["", "Error of H from sampled records without noise:", ""]
    lines += ["| sampling period | " + " | ".join(FORMS) + " |", "|---" * (1 + len(FORMS)) + "|"]
    for at, period in enumerate(PERIODS):
        lines.append(f"| {period:.2f} s | " + " | ".join(f"{one:.1e}" for one in result.form_error[:, at]) + " |")
    return lines


def plot(result: DduioResult, out_dir: Path) -> list[Path]:
    """Draw states and errors of all nodes for three methods, the Monte Carlo comparison, and the forms of data."""
    out_dir.mkdir(parents=True, exist_ok=True)
    states = Figure(figsize=(13.0, 9.0), layout="constrained")
    for column, panels in enumerate(states.subplots(4, 3, sharex=True, sharey="row").T):
        for row, axes in enumerate(panels):
            for node in range(5):
                axes.plot(result.t, result.estimates[column][:, node, row], "--", linewidth=1, label=f"node {node + 1}")
            axes.plot(result.t, result.x[:, row], "k-", linewidth=1, label="state")
            axes.set_ylabel(LABELS[row])
        panels[0].set_title(METHODS[column])
        panels[-1].set_xlabel("t [s]")
    panels[0].legend(fontsize="small")
    errors = Figure(figsize=(13.0, 4.0), layout="constrained")
    for column, axes in enumerate(errors.subplots(1, 3, sharey=True)):
        for node in range(5):
            misfit = np.linalg.norm(result.estimates[column][:, node] - result.x, axis=1)
            axes.semilogy(result.t, misfit, label=f"node {node + 1}")
        axes.set(title=METHODS[column], xlabel="t [s]", ylabel="|x - xhat|")
    axes.legend(fontsize="small")
    paths = [out_dir / name for name in ("dduio_states.png", "dduio_errors.png", "dduio_comparison.png")]
    states.savefig(paths[0], dpi=100)
    errors.savefig(paths[1], dpi=120)
    _plot_comparison(result).savefig(paths[2], dpi=120)
    return paths


def _plot_comparison(result: DduioResult) -> Figure:
    figure = Figure(figsize=(13.0, 4.0), layout="constrained")
    panels = figure.subplots(1, 4)
    for axes, (name, values) in zip(
        panels, (("MSE", result.mse), ("MAE", result.mae), ("MAE, second half", result.late_mae)), strict=False
    ):
        for row, method in enumerate(METHODS):
            mean, low, high = interval(values[:, row])
            axes.errorbar(mean, -row, xerr=[[mean - low], [high - mean]], fmt="o", capsize=4, label=method)
        axes.set(title=f"{name}, 95 % interval", yticks=[])
    panels[2].legend(fontsize="x-small", loc="upper right")
    for name, errors in zip(FORMS, result.form_error, strict=True):
        panels[3].loglog(PERIODS, errors, "o-", label=name)
    panels[3].set(title="error of H from sampled data", xlabel="sampling period [s]", ylabel="|H - H_true|")
    panels[3].legend(fontsize="small")
    return figure


def _models(wrong: float = 0.0, generator: np.random.Generator | None = None) -> tuple[NodeModel, ...]:
    """The plant from every node's perspective; Bbar off by a relative error if asked for."""
    models = []
    for known, measured in zip(KNOWN, MEASURED, strict=True):
        Bbar = np.column_stack([np.delete(B, known, axis=1), B_W])
        if generator is not None:
            Bbar = Bbar + wrong * np.linalg.norm(Bbar) / 2.0 * _direction(Bbar, generator)
        models.append(NodeModel(A=A, B=B[:, list(known)], Bbar=Bbar, C=np.eye(4)[list(measured)]))
    return tuple(models)


def _direction(Bbar: NDArray[np.float64], generator: np.random.Generator) -> NDArray[np.float64]:
    """Unit error that keeps the rank of Bbar: every input acts through the same wrong directions."""
    rank = int(np.linalg.matrix_rank(Bbar))
    right = np.linalg.svd(Bbar, full_matrices=False)[2]
    drawn = generator.standard_normal((len(Bbar), rank))
    return np.asarray(drawn / np.linalg.norm(drawn) @ right[:rank])


def _records(generator: np.random.Generator, noise: float) -> list[Regressors]:
    """For every node 40 instants of a trajectory of its own and 10 to hold back, states and derivatives with noise."""
    data = []
    for known, measured in zip(KNOWN, MEASURED, strict=True):
        x, v = _trajectory(400, 0.1, generator)
        picked = np.sort(generator.choice(len(x), SAMPLES + HELD_BACK, replace=False))
        x, v = x[picked], v[picked]
        xdot = x @ A.T + v @ np.column_stack([B, B_W]).T
        x, xdot = (signal + noise * generator.standard_normal(signal.shape) for signal in (x, xdot))
        rows = list(measured)
        data.append(derivatives(v[:, list(known)], x[:, rows], x, xdot[:, rows], xdot))
    return data


def _trajectory(
    steps: int, step_sec: float, generator: np.random.Generator, hold: int = 1
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """States and (u1, u2, w) ~ U(-1, 1), held over `hold` samples."""
    inputs = np.repeat(generator.uniform(-1.0, 1.0, (steps // hold + 1, 3)), hold, axis=0)[:steps]
    moved = expm(np.block([[A, B, B_W], [np.zeros((3, 7))]]) * step_sec)[:4]
    x, rows = generator.uniform(-1.0, 1.0, 4), []
    for v in inputs:
        rows.append(x)
        x = moved @ np.concatenate([x, v])
    return np.array(rows), inputs


def _exact_late(generator: np.random.Generator, truth: DistributedDesign) -> NDArray[np.float64]:
    """Mean absolute error of each method over the second half of one run, designed from data without noise."""
    designs = _designs(generator, truth, noise=0.0)
    if designs is None:
        return np.full(len(METHODS), np.nan)
    x, estimates = _online(designs, generator)
    half = len(x) // 2
    return np.array([np.mean(np.abs(found - x[:, None, :])[half:]) for found in estimates])


def _designs(
    generator: np.random.Generator, truth: DistributedDesign, noise: float = NOISE
) -> tuple[DistributedDesign, ...] | None:
    """All methods on one set of data, or None when one of them is refused."""
    data = _records(generator, noise)
    seen = [one.part(0, SAMPLES) for one in data]
    made = (
        truth,
        design(data, ring(5), {"unknown_inputs": UNKNOWN}),
        jointly_identified(seen, _models(), KNOWN, ring(5), {}),
        identification_based(seen, _models(), ring(5), {}),
        identification_based(seen, _models(WRONG, generator), ring(5), {}),
    )
    return made if all(one.accepted for one in made) else None


def _online(
    designs: Sequence[DistributedDesign], generator: np.random.Generator
) -> tuple[NDArray[np.float64], list[NDArray[np.float64]]]:
    """One run of the plant with every network from z = 0; u are sinusoids, w is white; all held over 0.05 s."""
    steps = round(DURATION_SEC / STEP_SEC)
    phases, start = generator.uniform(0.0, 2.0 * np.pi, 2), generator.uniform(-1.0, 1.0, 4)
    t = np.arange(steps)[:, None] * STEP_SEC
    inputs = np.hstack([np.sin(np.array([0.9, 1.7]) * t + phases), generator.uniform(-1.0, 1.0, (steps, 1))])
    found = []
    for made in designs:
        moved = expm(_joint(made.gains, made) * STEP_SEC)
        state, rows = np.concatenate([start, np.zeros(20)]), []
        for v in inputs:
            rows.append(state)
            state = moved[:24] @ np.concatenate([state, v])
        whole = np.array(rows)
        x = whole[:, :4]
        nodes = [
            whole[:, 4 + 4 * node : 8 + 4 * node] + x @ (one.H @ np.eye(4)[list(MEASURED[node])]).T
            for node, one in enumerate(made.gains)
        ]
        found.append(np.stack(nodes, axis=1))
    return x, found


def _joint(gains: Sequence[NodeGains], made: DistributedDesign) -> NDArray[np.float64]:
    """Matrix of d/dt [x; z_1 … z_5; u; w], inputs held, D (1) and (6)."""
    joint = np.zeros((27, 27))
    joint[:4, :4], joint[:4, 24:26], joint[:4, 26:] = A, B, B_W
    for node, one in enumerate(gains):
        rows, C = slice(4 + 4 * node, 8 + 4 * node), np.eye(4)[list(MEASURED[node])]
        joint[rows, rows] += one.E
        joint[rows, :4] += one.L @ C
        joint[rows, [24 + known for known in KNOWN[node]]] += one.F
        for other in made.network.neighbours(node):
            theirs, C_other = slice(4 + 4 * other, 8 + 4 * other), np.eye(4)[list(MEASURED[other])]
            joint[rows, theirs] += one.chi * np.eye(4)
            joint[rows, rows] -= one.chi * np.eye(4)
            joint[rows, :4] += one.chi * (gains[other].H @ C_other - one.H @ C)
    return joint


def _form_errors(generator: np.random.Generator, truth: DistributedDesign) -> NDArray[np.float64]:
    """Error of H from records sampled without derivatives, in three forms; inputs are held over 0.2 s."""
    errors = np.empty((len(FORMS), len(PERIODS)))
    for column, period in enumerate(PERIODS):
        histories = []
        for known, measured in zip(KNOWN, MEASURED, strict=True):
            x, v = _trajectory(round(60.0 / period), period, generator, hold=round(0.2 / period))
            experiment = Experiment(v[:, list(known)], x[:, list(measured)], x)
            histories.append(History((experiment,), period))
        forms = (
            [differences(one) for one in histories],
            [filtered(one, 0.3) for one in histories],
            [integral(one, round(0.5 / period)) for one in histories],
        )
        for row, data in enumerate(forms):
            made = design(data, ring(5), {"unknown_inputs": UNKNOWN})
            errors[row, column] = _distance(made.gains, truth.gains) if made.accepted else np.nan
    return errors


def _distance(gains: Sequence[NodeGains], truth: Sequence[NodeGains]) -> float:
    """Mean over the nodes of |H - H_true|."""
    return float(np.mean([np.linalg.norm(one.H - two.H) for one, two in zip(gains, truth, strict=True)]))
