"""Plants and histories that the tests of the monitors share."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.linalg import expm

from monitor.history import Experiment, History

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

T_S = 0.01

# R_t [ohm], L_t [H], C_t [F], k1, k2, k3 of Gallo's six DGUs (theory, section 1).
PARAMETERS = (
    (0.2, 1.8e-3, 2.2e-3, -2.134, -0.163, 13.553),
    (0.3, 2.0e-3, 1.9e-3, -0.869, -0.050, 48.285),
    (0.1, 2.2e-3, 1.7e-3, -0.480, -0.108, 30.673),
    (0.5, 3.0e-3, 2.5e-3, -6.990, -0.175, 102.960),
    (0.4, 1.3e-3, 2.0e-3, -0.101, -0.010, 16.393),
    (0.6, 2.5e-3, 3.0e-3, -2.134, -0.163, 13.553),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plant:
    """x+ = A x + B u + E d, y = C x; comparable: in units in which norms may be taken."""

    A: NDArray[np.float64]
    B: NDArray[np.float64]
    E: NDArray[np.float64]
    C: NDArray[np.float64]
    comparable: bool = False

    def run(
        self, x: NDArray[np.float64], u: NDArray[np.float64], d: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Outputs (T, p) and states (T, n) from x under u (T, m) and d (T, m_d)."""
        rows = [x]
        for known, unknown in zip(u[:-1], d[:-1], strict=True):
            rows.append(self.A @ rows[-1] + self.B @ known + self.E @ unknown)
        states = np.array(rows)
        return states @ self.C.T, states

    def history(
        self,
        generator: np.random.Generator,
        *,
        samples: int = 20,
        experiments: int = 1,
        mean: tuple[float, ...] | float = 0.0,
        noise_std: float = 0.0,
    ) -> History:
        """Random experiments: start, u, d - mean uniform in (-1, 1); noise on x, and y = C x of what is read."""
        recorded = []
        for _ in range(experiments):
            u = generator.uniform(-1.0, 1.0, (samples, self.B.shape[1]))
            d = np.asarray(mean) + generator.uniform(-1.0, 1.0, (samples, self.E.shape[1]))
            _, x = self.run(generator.uniform(-1.0, 1.0, len(self.A)), u, d)
            x = x + noise_std * generator.standard_normal(x.shape)
            recorded.append(Experiment(u, x @ self.C.T, x))
        return History(tuple(recorded), T_S, self.comparable)


def dgu_plant(number: int) -> Plant:
    """Isolated DGU 1 to 6, T (17) and (18)."""
    R_t, L_t, C_t, k1, k2, k3 = PARAMETERS[number - 1]
    joined = np.zeros((5, 5))
    joined[:3, :3] = [[0.0, 1.0 / C_t, 0.0], [(k1 - 1.0) / L_t, (k2 - R_t) / L_t, k3 / L_t], [-1.0, 0.0, 0.0]]
    joined[:3, 3:] = [[-1.0 / C_t, 0.0], [0.0, 0.0], [0.0, 1.0]]
    sampled = expm(joined * T_S)
    return Plant(A=sampled[:3, :3], B=np.zeros((3, 0)), E=sampled[:3, 3:], C=np.eye(3), comparable=True)


def random_plant(seed: int) -> Plant:
    """Random plant: n to 8, p to n, m_d to p, m to 2; stable or not; a quarter of them break rank CE = rank E."""
    generator = np.random.default_rng(seed)
    n = int(generator.integers(2, 9))
    p = int(generator.integers(1, n + 1))
    m_d, m = int(generator.integers(0, min(p, n - 1) + 1)), int(generator.integers(0, 3))
    A = generator.standard_normal((n, n))
    A *= generator.uniform(0.5, 1.3) / np.max(np.abs(np.linalg.eigvals(A)))
    B, C, E = (generator.standard_normal(shape) for shape in ((n, m), (p, n), (n, m_d)))
    if generator.integers(0, 4) == 0 and m_d and p < n:
        E[:, 0] = (np.eye(n) - np.linalg.pinv(C) @ C) @ generator.standard_normal(n)
    return Plant(A=A, B=B, E=E, C=C)


def observer_exists(plant: Plant) -> bool:
    """The model-based conditions: rank CE = rank E, and no zero of [zI - A, -E; C, 0] with |z| >= 1."""
    A, E, C = plant.A, plant.E, plant.C
    n, m_d = E.shape
    if m_d and np.linalg.matrix_rank(C @ E, tol=1e-8) < m_d:
        return False
    # Zeros are among the eigenvalues of the decoupled A: test the pencil there.
    candidates = np.linalg.eigvals(A - E @ np.linalg.pinv(C @ E) @ C @ A)
    for z in candidates[np.abs(candidates) >= 1.0]:
        pencil = np.block([[z * np.eye(n) - A, -E], [C, np.zeros((len(C), m_d))]])
        if np.linalg.svd(pencil, compute_uv=False)[-1] < 1e-7:
            return False
    return True


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomCase:
    """A random plant, whether an observer exists for it, and an exact history of it."""

    seed: int
    plant: Plant
    exists: bool
    history: History


@pytest.fixture(scope="session")
def random_cases() -> list[RandomCase]:
    """200 random plants with six short experiments each: short ones keep unstable plants in range."""
    cases = []
    for seed in range(200):
        plant = random_plant(seed)
        history = plant.history(np.random.default_rng(seed + 1000), samples=12, experiments=6)
        cases.append(RandomCase(seed=seed, plant=plant, exists=observer_exists(plant), history=history))
    return cases


@pytest.fixture
def dgu() -> Callable[[int], Plant]:
    """Make an isolated DGU by its number."""
    return dgu_plant


@pytest.fixture
def dgu_history() -> Callable[..., History]:
    """Make T's history of a DGU: number, seed, and what `Plant.history` takes."""

    def make(number: int = 1, seed: int = 0, **options: float) -> History:
        generator = np.random.default_rng(seed)
        samples = int(options.get("samples", 20))
        noise_std = options.get("noise_std", 0.0)
        return dgu_plant(number).history(generator, samples=samples, mean=(11.0, 50.0), noise_std=noise_std)

    return make


@pytest.fixture
def scenario_path() -> Path:
    """The shipped scenario of the six-DGU grid."""
    root = Path(__file__).parents[2]
    return root / "dcmg/scenarios/gallo_six_dgu.yaml"
