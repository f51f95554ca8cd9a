"""Turan and Ferrari-Trecate (2021): the data-driven UIO of one DGU, Figures 2 and 3."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from dcmg.papers.check import Check
from dgu_sim.matrices import continuous, discretise
from dgu_sim.parameters import DguParameters
from monitor.history import single
from monitor.observers import LinearObserver
from monitor.observers import design as design_observer

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from monitor.observers import Design

T_S = 0.01  # sampling period [s]
HISTORY_SAMPLES = 20
SAFE_STEPS = 10  # Figure 2
STEPS = 100  # Figure 3
ATTACK_STEP = 50
BIAS = (0.1, 0.1, 0.1)  # V [V], I_t [A], v [V s]
LABELS = ("V [V]", "I_t [A]", "v [V s]")

# Six DGUs of Gallo et al. (2020), as published with the experiment; the paper uses the first.
DGUS = (
    DguParameters(R_t=0.2, L_t=1.8e-3, C_t=2.2e-3, k1=-2.134, k2=-0.163, k3=13.553),
    DguParameters(R_t=0.3, L_t=2.0e-3, C_t=1.9e-3, k1=-0.869, k2=-0.050, k3=48.285),
    DguParameters(R_t=0.1, L_t=2.2e-3, C_t=1.7e-3, k1=-0.480, k2=-0.108, k3=30.673),
    DguParameters(R_t=0.5, L_t=3.0e-3, C_t=2.5e-3, k1=-6.990, k2=-0.175, k3=102.960),
    DguParameters(R_t=0.4, L_t=1.3e-3, C_t=2.0e-3, k1=-0.101, k2=-0.010, k3=16.393),
    DguParameters(R_t=0.6, L_t=2.5e-3, C_t=3.0e-3, k1=-2.134, k2=-0.163, k3=13.553),
)

EXPECTED_A = ((-0.28837, 0.10333, 5.39842), (-0.40767, -0.33421, 1.71161), (-0.00055, -0.00072, 0.95996))
EXPECTED_E = ((-0.24792, 0.04004), (1.28837, 0.01188), (0.00179, 0.0098))
EXPECTED_EIGENVALUE = (-0.1714, 0.0914, 0.2793, -0.1234, 0.1092, 0.1088)  # the one that is not 0, DGU 1 to 6
EXPECTED_ONSET = (-0.0148, -0.0029, 0.0642)  # r(50)
EXPECTED_STEADY = (-0.0178, -0.0035, 0.0769)
TOLERANCE = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class TuranResult:
    """Everything the paper shows, as arrays.

    Attributes:
        seed: of the history and of the online run.
        A: (3, 3) of DGU 1, T (18).
        E: (3, 2).
        designs: observers of DGU 1 to 6, each from a history with the same seed.
        x: (100, 3) true states of the online run.
        estimate: (100, 3) estimates; attacked from step 50 on.
        residual: (100, 3) r = y^c - xhat.
    """

    seed: int
    A: NDArray[np.float64]
    E: NDArray[np.float64]
    designs: tuple[Design, ...]
    x: NDArray[np.float64]
    estimate: NDArray[np.float64]
    residual: NDArray[np.float64]


def run(seed: int = 0) -> TuranResult:
    """Design the observers from random histories and run DGU 1 for 100 steps, attacked from step 50 on."""
    models = [discretise(*continuous(parameters), T_S) for parameters in DGUS]
    designs = tuple(_designed(A, E, np.random.default_rng((seed, number))) for number, (A, E) in enumerate(models))
    A, E = models[0]
    generator = np.random.default_rng((seed, len(DGUS)))
    start = np.array([46.78, 9.0, 11.0]) + generator.uniform(-1.0, 1.0, 3)
    inputs = np.array([9.0, 47.0]) + 0.1 * generator.uniform(-1.0, 1.0, (STEPS, 2))
    x = _trajectory(A, E, start, inputs)
    guess = start + 0.1 * generator.uniform(-1.0, 1.0, 3)
    received = x.copy()
    received[ATTACK_STEP:] += BIAS
    estimate, residual = _observed(designs[0], received, guess)
    return TuranResult(seed=seed, A=A, E=E, designs=designs, x=x, estimate=estimate, residual=residual)


def checks(result: TuranResult) -> list[Check]:
    """Compare with the numbers published with the paper's experiment."""
    found = [
        *_entries("A", result.A, EXPECTED_A),
        *_entries("E", result.E, EXPECTED_E),
        *_entries("r(50)", result.residual[ATTACK_STEP : ATTACK_STEP + 1], (EXPECTED_ONSET,)),
        *_entries("steady r", result.residual[-1:], (EXPECTED_STEADY,)),
    ]
    for number, (design, expected) in enumerate(zip(result.designs, EXPECTED_EIGENVALUE, strict=True), start=1):
        dynamics = design.certificate.dynamics
        eigenvalues = np.full((3, 2), np.nan) if dynamics is None else dynamics.eigenvalues
        eigenvalues = eigenvalues[np.argsort(-np.hypot(eigenvalues[:, 0], eigenvalues[:, 1]))]
        found += _entries(f"eig A_UIO of DGU {number}", eigenvalues[:, :1].T, ((expected, 0.0, 0.0),))
    return found


def plot(result: TuranResult, out_dir: Path) -> list[Path]:
    """Draw Figure 2 (states and estimates without attack) and Figure 3 (residuals, attack from step 50)."""
    safe = Figure(figsize=(6.0, 6.0), layout="constrained")
    for row, axes in enumerate(safe.subplots(3, 1, sharex=True)):
        axes.plot(result.x[: SAFE_STEPS + 1, row], "k-", label="state")
        axes.plot(result.estimate[: SAFE_STEPS + 1, row], "r--", label="estimate")
        axes.set_ylabel(LABELS[row])
        axes.legend(loc="upper right")
    axes.set_xlabel("step of 10 ms")
    attacked = Figure(figsize=(6.0, 6.0), layout="constrained")
    for row, axes in enumerate(attacked.subplots(3, 1, sharex=True)):
        axes.plot(result.residual[:, row], "b-")
        axes.axvline(ATTACK_STEP, color="k", linestyle=":")
        axes.set_ylabel(f"residual of {LABELS[row]}")
    axes.set_xlabel("step of 10 ms")
    out_dir.mkdir(parents=True, exist_ok=True)
    paths = [out_dir / "turan_2021_fig2.png", out_dir / "turan_2021_fig3.png"]
    safe.savefig(paths[0], dpi=150)
    attacked.savefig(paths[1], dpi=150)
    return paths


def _trajectory(
    A: NDArray[np.float64], E: NDArray[np.float64], start: NDArray[np.float64], inputs: NDArray[np.float64]
) -> NDArray[np.float64]:
    """States from the start under held inputs (steps, 2)."""
    rows = [start]
    for d in inputs[:-1]:
        rows.append(A @ rows[-1] + E @ d)
    return np.array(rows)


def _designed(A: NDArray[np.float64], E: NDArray[np.float64], generator: np.random.Generator) -> Design:
    """Run the offline experiment on an isolated DGU and design T's observer from it."""
    start = generator.uniform(-1.0, 1.0, 3)
    inputs = np.array([11.0, 50.0]) + generator.uniform(-1.0, 1.0, (HISTORY_SAMPLES, 2))
    x = _trajectory(A, E, start, inputs)
    return design_observer("full_order", replace(single(np.zeros((len(x), 0)), x, x, T_S), comparable=True), {})


def _observed(
    design: Design, received: NDArray[np.float64], guess: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Run the observer from the first estimate `guess`: z_0 = xhat_0 - D y_0."""
    observer = design.observer
    if not isinstance(observer, LinearObserver):
        raise TypeError(f"DGU 1: {design.verdict}")
    state = guess - observer.D @ received[0]
    estimates, residuals = [], []
    for y in received:
        state, output = observer.step(state, (), y)
        estimates.append(output.estimate)
        residuals.append(output.residual)
    return np.array(estimates), np.array(residuals)


def _entries(name: str, found: NDArray[np.float64], expected: tuple[tuple[float, ...], ...]) -> list[Check]:
    """One check for each entry of a matrix."""
    return [
        Check(name=f"{name}[{row}, {column}]", value=float(found[row, column]), expected=entry, tolerance=TOLERANCE)
        for row, entries in enumerate(expected)
        for column, entry in enumerate(entries)
    ]
