"""Data-driven reduced-order UIO: an example of order two, and one that no observer exists for.

The paper's own matrices are not available; these have the same sizes (theory, section 4).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from dcmg.papers.check import Check
from monitor.history import Experiment, History
from monitor.observers import LinearObserver
from monitor.observers import design as design_observer

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from monitor.observers import Design

A = np.array([[0.5, 0.2, 0.0, 0.1], [0.1, 0.4, 0.3, 0.0], [0.0, 0.2, 0.6, 0.1], [0.2, 0.0, 0.1, 0.3]])
B = np.array([[1.0], [0.0], [0.5], [0.0]])
E = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 1.0]])
C = np.array([[1.0, 0.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]])
C_IMPOSSIBLE = np.array([[1.0, 1.0, 0.0, 0.0], [0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]])  # rank CE = 1 < 2

SAMPLES = 50
STEPS = 40
OPTIONS: dict[str, object] = {"allow_blind": True}  # p = m_d: an estimate, but no residual
EXPECTED_EIGENVALUES = (0.55, 0.40)


@dataclass(frozen=True, slots=True, kw_only=True)
class RuioResult:
    """Both designs and a run of the first.

    Attributes:
        design: from y = C x.
        refused: from y = C_IMPOSSIBLE x.
        x: (40, 4) true states under u = sin and random d.
        estimate: (40, 4).
    """

    design: Design
    refused: Design
    x: NDArray[np.float64]
    estimate: NDArray[np.float64]


def run(seed: int = 0) -> RuioResult:
    """Record both histories, design, and run the observer that exists."""
    generator = np.random.default_rng(seed)
    u, d = generator.uniform(-5.0, 5.0, (SAMPLES, 1)), generator.uniform(-2.0, 2.0, (SAMPLES, 2))
    x = _trajectory(generator.uniform(-1.0, 1.0, 4), u, d)
    designs = [
        design_observer("reduced_order", History((Experiment(u, x @ output.T, x),), 1.0), OPTIONS)
        for output in (C, C_IMPOSSIBLE)
    ]
    u, d = np.sin(0.3 * np.arange(STEPS))[:, None], generator.uniform(-1.0, 1.0, (STEPS, 2)) * (3.0, 1.0)
    x = _trajectory(generator.uniform(-5.0, 5.0, 4), u, d)
    return RuioResult(design=designs[0], refused=designs[1], x=x, estimate=_observed(designs[0], u, x @ C.T))


def checks(result: RuioResult) -> list[Check]:
    """Order, eigenvalues, identified C, vanishing error, and the refusal of the second system."""
    certificate = result.design.certificate
    dynamics, matrices = certificate.dynamics, certificate.matrices
    eigenvalues = sorted(np.full(2, np.nan) if dynamics is None else dynamics.eigenvalues[:, 0], reverse=True)
    identified = np.full(C.shape, np.nan) if matrices is None else matrices["C"]
    named = "rank CE < rank E" in result.refused.verdict
    return [
        Check(name="order", value=float("nan") if dynamics is None else dynamics.order, expected=2, tolerance=0),
        *(
            Check(name=f"eigenvalue {number}", value=float(found), expected=expected, tolerance=1e-6)
            for number, (found, expected) in enumerate(zip(eigenvalues, EXPECTED_EIGENVALUES, strict=False), start=1)
        ),
        Check(name="|C - identified C|", value=float(np.max(np.abs(identified - C))), expected=0.0, tolerance=1e-9),
        Check(name="error at the end", value=_last_error(result), expected=0.0, tolerance=1e-6),
        Check(name="second system refused for rank CE < rank E", value=float(named), expected=1.0, tolerance=0.0),
    ]


def plot(result: RuioResult, out_dir: Path) -> list[Path]:
    """Draw the estimation error over time."""
    figure = Figure(figsize=(6.0, 3.5), layout="constrained")
    axes = figure.subplots()
    error = result.estimate - result.x
    for state in range(error.shape[1]):
        axes.plot(error[:, state], label=f"x{state + 1}")
    axes.set_xlabel("step")
    axes.set_ylabel("estimation error")
    axes.legend()
    out_dir.mkdir(parents=True, exist_ok=True)
    path = out_dir / "ruio_example.png"
    figure.savefig(path, dpi=150)
    return [path]


def _trajectory(start: NDArray[np.float64], u: NDArray[np.float64], d: NDArray[np.float64]) -> NDArray[np.float64]:
    rows = [start]
    for known, unknown in zip(u[:-1], d[:-1], strict=True):
        rows.append(A @ rows[-1] + B @ known + E @ unknown)
    return np.array(rows)


def _observed(design: Design, u: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Estimates (steps, 4), NaN when there is no observer."""
    observer = design.observer
    if not isinstance(observer, LinearObserver):
        return np.full((len(y), 4), np.nan)
    state = observer.init(tuple(u[0]), tuple(y[0]))
    rows = []
    for known, output in zip(u, y, strict=True):
        state, found = observer.step(state, tuple(known), tuple(output))
        rows.append(found.estimate)
    return np.array(rows)


def _last_error(result: RuioResult) -> float:
    return float(np.max(np.abs(result.estimate[-1] - result.x[-1])))
