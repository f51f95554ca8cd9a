"""Which method for noisy histories: measured on plant families, not argued.

Every method designs the minimum-norm observer from the same noisy samples, told the number of unknown inputs. The
observer then watches the true, noise-free plant under random unknown inputs: what its residual shows is design error.
That floor divided by the residual gain is the smallest bias the observer can tell from its own error.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from dcmg.papers.turan_2021 import DGUS, T_S
from dgu_sim.matrices import continuous, discretise
from monitor.baselines import identify_then_design
from monitor.errors import MonitorError
from monitor.history import Experiment, History
from monitor.observers import LinearObserver, design

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

NOISE_STD = (1e-3, 1e-2, 3e-2)
SAMPLES = (40, 200, 1000)
REPEATS = 4  # for averaging: the same number of samples, spent on repetitions
METHODS = ("truncation", "regression", "total_least_squares", "structured", "averaging", "identify_then_design")
LINE_CONDUCTANCES = (44.3, 45.0, 31.0, 54.2, 25.0, 22.5)  # sum of 1/R_ij at DGU 1 to 6 of the six-DGU grid [S]
ONLINE_STEPS = 200
SETTLED = 50  # steps after which the observer's start has died out


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """Plants of one kind.

    Attributes:
        name: for the table.
        plants: pairs A (n, n) and E (n, m_d); y = x.
        mean: (m_d,) operating value of d.
    """

    name: str
    plants: tuple[tuple[NDArray[np.float64], NDArray[np.float64]], ...]
    mean: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseResult:
    """Smallest bias told from design error, NaN where the design was refused.

    Attributes:
        families: names, first axis.
        noise_std: standard deviations of the noise, second axis.
        samples: samples in the history, third axis.
        smallest: (families, noise levels, samples, methods, trials).
    """

    families: tuple[str, ...]
    noise_std: tuple[float, ...]
    samples: tuple[int, ...]
    smallest: NDArray[np.float64]


def families(seed: int = 0) -> tuple[Family, ...]:
    """Isolated DGUs, DGUs on their lines, and random stable plants with four states and two unknown inputs."""
    isolated = tuple(discretise(*continuous(parameters), T_S) for parameters in DGUS)
    connected = tuple(
        discretise(*continuous(parameters, conductance), T_S)
        for parameters, conductance in zip(DGUS, LINE_CONDUCTANCES, strict=True)
    )
    generator = np.random.default_rng(seed)
    drawn = []
    for _ in range(6):
        A = generator.standard_normal((4, 4))
        A *= generator.uniform(0.5, 0.95) / np.max(np.abs(np.linalg.eigvals(A)))
        drawn.append((A, generator.standard_normal((4, 2))))
    return (
        Family(name="isolated DGUs", plants=isolated, mean=(11.0, 50.0)),
        Family(name="DGUs on their lines", plants=connected, mean=(-2000.0, 50.0)),
        Family(name="random plants", plants=tuple(drawn), mean=(0.0, 0.0)),
    )


def run(
    seed: int = 0, trials: int = 3, noise_std: Sequence[float] = NOISE_STD, samples: Sequence[int] = SAMPLES
) -> NoiseResult:
    """Compare all methods; `trials` histories for each plant."""
    kinds = families(seed)
    count = max(len(family.plants) for family in kinds) * trials
    smallest = np.full((len(kinds), len(noise_std), len(samples), len(METHODS), count), np.nan)
    cases = product(enumerate(kinds), enumerate(noise_std), enumerate(samples), range(count))
    for (row, family), (level, std), (size, length), number in cases:
        A, E = family.plants[number % len(family.plants)]
        key = (seed, row, level, size, number)
        once = _history((A, E), family.mean, length, std, np.random.default_rng(key))
        often = _history((A, E), family.mean, length // REPEATS, std, np.random.default_rng(key), repeats=REPEATS)
        for position, method in enumerate(METHODS):
            observer = _designed(often if method == "averaging" else once, E.shape[1], method)
            if observer is not None:
                online = np.random.default_rng(key)
                smallest[row, level, size, position, number] = _smallest_bias((A, E), family.mean, observer, online)
    return NoiseResult(
        families=tuple(family.name for family in kinds),
        noise_std=tuple(noise_std),
        samples=tuple(samples),
        smallest=smallest,
    )


def table(result: NoiseResult) -> str:
    """Markdown: median smallest bias for each family, noise level and length; refused designs in brackets."""
    lines = ["| family | noise | samples | " + " | ".join(METHODS) + " |", "|---" * (len(METHODS) + 3) + "|"]
    for row, name in enumerate(result.families):
        for level, std in enumerate(result.noise_std):
            for size, samples in enumerate(result.samples):
                cells = [_cell(result.smallest[row, level, size, method]) for method in range(len(METHODS))]
                lines.append(f"| {name} | {std:g} | {samples} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def ranking(result: NoiseResult) -> list[tuple[str, float, float]]:
    """Each method with the geometric mean of its smallest bias relative to the best of each case, and refused share.

    Only cases in which no method refused count for the mean.
    """
    everywhere = np.asarray(np.isfinite(result.smallest).all(axis=3))
    relative = np.log(result.smallest / np.nanmin(result.smallest, axis=3, keepdims=True))
    found = []
    for position, method in enumerate(METHODS):
        counted = relative[:, :, :, position][everywhere]
        refused = float(np.mean(~np.isfinite(result.smallest[:, :, :, position])))
        found.append((method, float(np.exp(np.mean(counted))), refused))
    return found


def plot(result: NoiseResult, out_dir: Path) -> list[Path]:
    """Median smallest bias over the number of samples, one panel for each family and noise level."""
    rows, columns = result.smallest.shape[:2]
    figure = Figure(figsize=(3.6 * columns, 2.8 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True)
    for row, column in product(range(rows), range(columns)):
        axes = grid[row][column]
        for position, method in enumerate(METHODS):
            values = [_median(result.smallest[row, column, size, position]) for size in range(len(result.samples))]
            axes.loglog(result.samples, values, "o-", label=method, markersize=3)
        axes.set_title(f"{result.families[row]}, noise {result.noise_std[column]:g}", fontsize=9)
        axes.grid(visible=True, alpha=0.3)
        if column == 0:
            axes.set_ylabel("smallest bias seen")
    for axes in grid[-1]:
        axes.set_xlabel("samples in the history")
    grid[0][0].legend(fontsize=7)
    out_dir.mkdir(parents=True, exist_ok=True)
    path = out_dir / "noise_methods.png"
    figure.savefig(path, dpi=80)
    return [path]


def write(out_dir: Path, seed: int = 1, trials: int = 8) -> list[Path]:
    """Measure anew and write the table (noise_methods.md) and the picture of docs/noise.md; takes some minutes."""
    result = run(seed, trials)
    lines = [f"- {method}: {factor:.2f}, {refused:.1%} refused" for method, factor, refused in ranking(result)]
    out_dir.mkdir(parents=True, exist_ok=True)
    path = out_dir / "noise_methods.md"
    path.write_text("\n".join([table(result), "", *lines, ""]))
    return [path, *plot(result, out_dir)]


def _history(
    plant: tuple[NDArray[np.float64], NDArray[np.float64]],
    mean: tuple[float, ...],
    samples: int,
    noise_std: float,
    generator: np.random.Generator,
    *,
    repeats: int = 1,
) -> History:
    """Noisy experiment from a random start, or repetitions of one with fresh noise."""
    A, E = plant
    d = np.array(mean) + generator.uniform(-1.0, 1.0, (samples, E.shape[1]))
    rows = [generator.uniform(-1.0, 1.0, len(A))]
    for sample in d[:-1]:
        rows.append(A @ rows[-1] + E @ sample)
    x = np.array(rows)
    noisy = [x + noise_std * generator.standard_normal(x.shape) for _ in range(repeats)]
    return History(tuple(Experiment(np.zeros((samples, 0)), one, one) for one in noisy), T_S, comparable=True)


def _designed(history: History, unknown_inputs: int, method: str) -> LinearObserver | None:
    """Observer by this method, None when refused."""
    if method == "identify_then_design":
        try:
            return identify_then_design(history, unknown_inputs, 0.5)
        except MonitorError:
            return None
    found = {"method": "total_least_squares", "repeated": True} if method == "averaging" else {"method": method}
    observer = design("full_order", history, {"unknown_inputs": unknown_inputs, **found}).observer
    return observer if isinstance(observer, LinearObserver) else None


def _smallest_bias(
    plant: tuple[NDArray[np.float64], NDArray[np.float64]],
    mean: tuple[float, ...],
    observer: LinearObserver,
    generator: np.random.Generator,
) -> float:
    """Largest residual on the noise-free plant over the largest steady gain of a bias."""
    A, E = plant
    x = np.linalg.solve(np.eye(len(A)) - A, E @ np.array(mean))
    state = observer.Z @ x
    floor = 0.0
    for step in range(ONLINE_STEPS):
        if step >= SETTLED:
            floor = max(floor, float(np.linalg.norm(observer.H @ state + observer.J @ x)))
        state = observer.A @ state + observer.B @ x
        x = A @ x + E @ (np.array(mean) + generator.uniform(-1.0, 1.0, E.shape[1]))
    gain = observer.J + observer.H @ np.linalg.solve(np.eye(observer.order) - observer.A, observer.B)
    return floor / float(np.linalg.norm(gain, 2))


def _median(values: NDArray[np.float64]) -> float:
    found = values[np.isfinite(values)]
    return float(np.median(found)) if found.size else float("nan")


def _cell(values: NDArray[np.float64]) -> str:
    refused = int(np.count_nonzero(~np.isfinite(values)))
    note = f" ({refused} refused)" if refused else ""
    return f"{_median(values):.2g}{note}" if refused < len(values) else "all refused"


if __name__ == "__main__":
    write(Path(sys.argv[1]))
