"""Shi, Lian and Jones (2022): inputs of an unstable plant reconstructed from its outputs alone, Figure 2."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from scipy.linalg import solve_discrete_are

from dcmg.papers.check import Check
from monitor.history import Experiment, History
from monitor.input_reconstruction import design

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from monitor.input_reconstruction import InputDesign

A = np.array([[0.9, 1.4, 0.2], [0.5, 1.5, 1.5], [1.6, 0.6, 0.4]])
B = np.array([[0.5, 1.0], [0.9, 0.3], [0.4, 0.3]])
C = np.array([[1.5, 1.0, 1.4], [0.6, 0.3, 0.3]])
D = np.array([[1.3, 1.8], [0.4, 0.7]])
PAST = 5  # N_ini
SAMPLES = 50  # T, offline
STEPS = 100  # T_tot, offline and online together
AUTHORS_SEED = 353
NOISE_LEVELS = (1e-4, 1e-3, 1e-2)
NOISE_SEEDS = 8
SETTLED = 25  # online steps left out of the noise figures: 0.83**25 < 1 %, the slowest radius seen
METHODS: dict[str, tuple[str, dict[str, object]]] = {
    "op-UIE, pseudo-inverse": ("op_uie", {}),
    "op-UIE, LMI": ("op_uie", {"poles": "lmi"}),
    "cl-UIE": ("cl_uie", {}),
}
NOISY_METHODS: dict[str, tuple[str, dict[str, object]]] = {
    "op-UIE, least squares": ("op_uie", {"fit": "least_squares"}),
    "cl-UIE, least squares": ("cl_uie", {"fit": "least_squares"}),
    "op-UIE, truncated": ("op_uie", {}),
    "cl-UIE, truncated": ("cl_uie", {}),
}
LARGEST_ZERO = {"D": 0.6751, "D = 0": 0.7797}
COMPLEX_ZERO = 0.603 + 0.277j  # of the plant with D, next to -.675
EXPECTED_RADIUS = {"D": (0.7216, 0.6751, 0.6751), "D = 0": (0.7797, 0.7797, 0.7797)}  # in the order of METHODS
DIGITS = 5e-5  # the page gives four digits
LMI_MARGIN = 2e-3  # the search over decays stops within 1e-3 of the best one, the solver within as much


@dataclass(frozen=True, slots=True, kw_only=True)
class UieCase:
    """One of the two plants.

    Attributes:
        name: `D` or `D = 0`.
        designs: one for each of METHODS.
        u: (100, 2) true inputs.
        estimates: for each method (100, 2), NaN before the first estimate, aligned with u.
    """

    name: str
    designs: tuple[InputDesign, ...]
    u: NDArray[np.float64]
    estimates: tuple[NDArray[np.float64], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class UieResult:
    """The experiment.

    Attributes:
        seed: of everything random; the authors' is 353.
        cases: with D and with D = 0.
        noise_error: (levels, methods) median over seeds of the root mean square input error, case D, noise on the
            record and online alike; NaN when every design was refused.
        noise_refused: (levels, methods) refused designs out of NOISE_SEEDS.
    """

    seed: int
    cases: tuple[UieCase, ...]
    noise_error: NDArray[np.float64]
    noise_refused: NDArray[np.int64]


def run(seed: int = AUTHORS_SEED) -> UieResult:
    """Record 50 samples, design the estimators and reconstruct the inputs of 100 samples from a zero guess."""
    cases = tuple(_case(name, feedthrough, future, seed) for name, feedthrough, future in _plants())
    errors, refused = _noise_study(seed)
    return UieResult(seed=seed, cases=cases, noise_error=errors, noise_refused=refused)


def checks(result: UieResult) -> list[Check]:
    """Spectral radii and zeros, which no data seed changes, and the error after 100 steps."""
    found = []
    for case in result.cases:
        radii = zip(METHODS, case.designs, EXPECTED_RADIUS[case.name], strict=True)
        for method, made, expected in radii:
            dynamics, zeros = made.certificate.dynamics, made.report.zeros
            radius = float("nan") if dynamics is None else dynamics.spectral_radius
            tolerance = LMI_MARGIN if method.endswith("LMI") else DIGITS
            found.append(
                Check(name=f"{case.name}: rho of {method}", value=radius, expected=expected, tolerance=tolerance)
            )
        largest = float("nan") if zeros is None else float(np.max(np.abs(zeros)))
        found.append(
            Check(name=f"{case.name}: zero", value=largest, expected=LARGEST_ZERO[case.name], tolerance=DIGITS)
        )
        if case.name == "D" and zeros is not None:
            upper = zeros[np.argmax(zeros.imag)]
            digits = 5e-4  # three of them are given
            found.append(
                Check(name="D: zero, real part", value=upper.real, expected=COMPLEX_ZERO.real, tolerance=digits)
            )
            imaginary, expected = float(upper.imag), COMPLEX_ZERO.imag
            found.append(Check(name="D: zero, imaginary part", value=imaginary, expected=expected, tolerance=digits))
        for method, estimate in zip(METHODS, case.estimates, strict=True):
            last = float(np.max(np.abs(estimate - case.u)[-case.designs[0].report.delay - 10 : -2]))
            # 0.78**85 times a first error of order 100 is 7e-8.
            found.append(Check(name=f"{case.name}: last error of {method}", value=last, expected=0.0, tolerance=1e-6))
    return found


def plot(result: UieResult, out_dir: Path) -> list[Path]:
    """Draw the inputs with their estimates, the errors (Figure 2), and the errors under noise."""
    out_dir.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(10.0, 8.0), layout="constrained")
    for column, (case, panels) in enumerate(zip(result.cases, figure.subplots(3, 2, sharex=True).T, strict=True)):
        for channel in range(2):
            panels[channel].plot(case.u[:40, channel], "k-", label="true input")
            for (method, _), estimate in zip(METHODS.items(), case.estimates, strict=True):
                panels[channel].plot(estimate[:40, channel], "--", label=method)
            panels[channel].set_ylabel(f"u{channel + 1}")
            panels[channel].set_ylim(-6.0, 6.0)
        for (method, _), estimate in zip(METHODS.items(), case.estimates, strict=True):
            panels[2].semilogy(np.linalg.norm(estimate - case.u, axis=1), label=method)
        panels[0].set_title(f"case {case.name}")
        panels[2].set_xlabel("step")
        if column == 0:
            panels[2].set_ylabel("norm of the input error")
            panels[2].legend()
    noise = Figure(figsize=(6.0, 4.0), layout="constrained")
    axes = noise.subplots()
    for method, errors in zip(NOISY_METHODS, result.noise_error.T, strict=True):
        axes.loglog(NOISE_LEVELS, errors, "o-", label=method)
    axes.set_xlabel("standard deviation of the output noise")
    axes.set_ylabel(f"input error (rms, median of {NOISE_SEEDS} seeds)")
    axes.legend()
    paths = [out_dir / "uie_fig2.png", out_dir / "uie_noise.png"]
    figure.savefig(paths[0], dpi=150)
    noise.savefig(paths[1], dpi=150)
    return paths


def _plants() -> tuple[tuple[str, NDArray[np.float64], int], ...]:
    """Name, D and output samples from t on (one more when D = 0)."""
    return ("D", D, 1), ("D = 0", np.zeros((2, 2)), 2)


def _case(name: str, feedthrough: NDArray[np.float64], future: int, seed: int) -> UieCase:
    u, y = _trajectory(feedthrough, seed, STEPS, 0.0)
    designs = tuple(
        design(kind, _record(u[:SAMPLES], y[:SAMPLES]), {"past": PAST, "future": future, **options})
        for kind, options in METHODS.values()
    )
    estimates = tuple(_reconstruct(made, y) for made in designs)
    return UieCase(name=name, designs=designs, u=u, estimates=estimates)


def _trajectory(
    feedthrough: NDArray[np.float64], seed: int, steps: int, noise: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Inputs U(-1.5, 1.5) + K x, K = -dlqr(A, B, I, I), and outputs with noise; random start."""
    P = solve_discrete_are(A, B, np.eye(3), np.eye(2))
    K = -np.linalg.solve(np.eye(2) + B.T @ P @ B, B.T @ P @ A)
    generator = np.random.RandomState(seed)  # the authors' stream, column-major: one column of draws a step
    drawn = generator.uniform(-1.5, 1.5, 2 * steps).reshape((2, steps), order="F")
    x, inputs, outputs = generator.uniform(-1.5, 1.5, 3), [], []
    for random_part in drawn.T:
        u = random_part + K @ x
        inputs.append(u)
        outputs.append(C @ x + feedthrough @ u)
        x = A @ x + B @ u
    return np.array(inputs), np.array(outputs) + noise * generator.standard_normal((steps, 2))


def _record(u: NDArray[np.float64], y: NDArray[np.float64]) -> History:
    """A record without states; the paper's time has no unit, so one step lasts 1 s."""
    return History((Experiment(u, y, np.empty((len(u), 0))),), 1.0, comparable=True)


def _reconstruct(made: InputDesign, y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Estimates aligned with the inputs they are of; the first window only fills the memory."""
    found = np.full((len(y), 2), np.nan)
    if made.observer is None:
        return found
    state = made.observer.init((), tuple(y[0]))
    for step, sample in enumerate(y):
        state, output = made.observer.step(state, (), tuple(sample))
        if step >= made.report.delay:
            found[step - made.report.delay] = output.estimate
    return found


def _noise_study(seed: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Errors of the second half of a run whose record and outputs carry the same noise."""
    errors = np.full((len(NOISE_LEVELS), len(NOISY_METHODS)), np.nan)
    refused = np.zeros(errors.shape, dtype=np.int64)
    for row, level in enumerate(NOISE_LEVELS):
        runs = [_trajectory(D, seed + number, STEPS, level) for number in range(NOISE_SEEDS)]
        for column, (kind, options) in enumerate(NOISY_METHODS.values()):
            found = []
            for u, y in runs:
                made = design(kind, _record(u[:SAMPLES], y[:SAMPLES]), {"past": PAST, "order": 3, **options})
                misfit = _reconstruct(made, y[SAMPLES:]) - u[SAMPLES:]
                found.append(float(np.sqrt(np.mean(misfit[SETTLED:] ** 2))))
            refused[row, column] = np.count_nonzero(np.isnan(found))
            if refused[row, column] < NOISE_SEEDS:
                errors[row, column] = np.nanmedian(found)
    return errors, refused
