"""Any C, any order of sensors, feedthrough, and unknown inputs that act on outputs directly."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from monitor.history import Experiment, History, single
from monitor.observers import LinearObserver, design
from monitor.trials import try_observer

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from monitor.observers import Design

KINDS = ("full_order", "reduced_order")
FAST: dict[str, object] = {"strategy": "dual_lqr", "decay": 0.9, "allow_blind": True}


@dataclass(frozen=True, slots=True, kw_only=True)
class General:
    """x+ = A x + B u + E d, y = C x + D u + G d."""

    A: NDArray[np.float64]
    B: NDArray[np.float64]
    C: NDArray[np.float64]
    D: NDArray[np.float64]
    E: NDArray[np.float64]
    G: NDArray[np.float64]

    def experiment(self, generator: np.random.Generator, samples: int, size: float = 1.0) -> Experiment:
        """Everything uniform in (-1, 1), the unknown inputs `size` times that."""
        u = generator.uniform(-1.0, 1.0, (samples, self.B.shape[1]))
        d = size * generator.uniform(-1.0, 1.0, (samples, self.E.shape[1]))
        x = [generator.uniform(-1.0, 1.0, len(self.A))]
        for known, unknown in zip(u[:-1], d[:-1], strict=True):
            x.append(self.A @ x[-1] + self.B @ known + self.E @ unknown)
        states = np.array(x)
        return Experiment(u, states @ self.C.T + u @ self.D.T + d @ self.G.T, states)

    def exists(self) -> bool:
        """Whether an unknown-input observer exists: rank and zeros of the model.

        rank [C E, G; G, 0] = rank G + rank [E; G], and [zI - A, -E; C, G] has full column rank for |z| >= 1: zeros are
        among the generalised eigenvalues of a random compression of that pencil.
        """
        n, m_d = self.E.shape
        p = len(self.C)
        if p < m_d:
            return False
        joint = np.block([[self.C @ self.E, self.G], [self.G, np.zeros_like(self.G)]])
        wanted = np.linalg.matrix_rank(self.G, tol=1e-9) + m_d
        if m_d and np.linalg.matrix_rank(joint, tol=1e-9) < wanted:
            return False
        mix = np.random.default_rng(0).standard_normal((n + m_d, n + p))
        constant = mix @ np.block([[-self.A, -self.E], [self.C, self.G]])
        along = mix @ np.vstack([np.eye(n, n + m_d), np.zeros((p, n + m_d))])
        inverse = np.linalg.eigvals(np.linalg.solve(constant, -along))  # 1 / z: infinite zeros become 0
        for z in 1.0 / inverse[np.abs(inverse) > 1e-9]:
            pencil = np.block([[z * np.eye(n) - self.A, -self.E], [self.C, self.G]])
            if abs(z) >= 1.0 and np.linalg.svd(pencil, compute_uv=False)[-1] < 1e-8:
                return False
        return True


def general(seed: int) -> General:
    """Random plant of 1 to 7 states with feedthrough; half of them with unknown inputs on some outputs."""
    generator = np.random.default_rng(seed)
    n, m = int(generator.integers(1, 8)), int(generator.integers(0, 3))
    p = int(generator.integers(1, n + 3))
    m_d = int(generator.integers(0, min(n - 1, p, 3) + 1))
    A = generator.standard_normal((n, n))
    A *= generator.uniform(0.3, 1.2) / np.max(np.abs(np.linalg.eigvals(A)))
    B, C, D, E, G = (generator.standard_normal(shape) for shape in ((n, m), (p, n), (p, m), (n, m_d), (p, m_d)))
    D *= generator.uniform(size=(p, 1)) < 0.5
    G *= (generator.uniform(size=(p, 1)) < 0.5) * (generator.uniform(size=(1, m_d)) < 0.5) * (seed % 2)
    return General(A=A, B=B, C=C, D=D, E=E, G=G)


def error_on(made: Design, experiment: Experiment) -> float:
    """Largest error of estimate and residual on fresh samples, relative to what moves."""
    assert isinstance(made.observer, LinearObserver)
    (trial,) = try_observer(made.observer, History((experiment,), 0.1))
    return float(max(np.max(np.abs(trial.error)), np.max(np.abs(trial.residual), initial=0.0)) / max(1.0, trial.size))


@pytest.mark.parametrize("kind", KINDS)
def test_general_outputs_are_decided_as_the_model_decides(kind: str) -> None:
    """With y = C x + D u + G d: accepted and right on fresh samples, or refused as the model says."""
    accepted = 0
    for seed in range(80):
        plant, generator = general(seed), np.random.default_rng(seed + 1000)
        made = design(kind, History(tuple(plant.experiment(generator, 12) for _ in range(8)), 0.1), FAST)
        if not made.accepted:
            structural = "T (13) fails" in made.verdict or "unstable zeros" in made.verdict
            assert structural or "cannot be reached" in made.verdict, (seed, made.verdict)
            assert not (structural and plant.exists()), (seed, made.verdict)
            continue
        accepted += 1
        # rounding of observers with a gain of some hundred
        assert error_on(made, plant.experiment(generator, 15, size=10.0)) < 1e-8, (seed, made.verdict)
    assert accepted > 30


@pytest.mark.parametrize("order", [(2, 0, 1), (1, 0, 2), (2, 1, 0)])
def test_sensors_in_any_order_give_the_same_observer(
    dgu_history: Callable[..., History], order: tuple[int, ...]
) -> None:
    """T allows any C: a permuted y gives the observer of the plain one with its columns permuted."""
    history = dgu_history(1, samples=40)
    one, columns = history.experiments[0], list(order)
    plain = design("full_order", history, {}).observer
    other = design("full_order", replace(history, experiments=(replace(one, y=one.x[:, columns]),)), {}).observer
    assert isinstance(plain, LinearObserver)
    assert isinstance(other, LinearObserver)
    assert np.allclose(other.A, plain.A, atol=1e-9)
    assert np.allclose(other.D, plain.D[:, columns], atol=1e-9)
    assert np.allclose(other.J, plain.J[columns][:, columns], atol=1e-9)


@pytest.mark.parametrize("factor", [0.5, 1.0, 1e-6])
def test_one_sensor_of_any_gain(factor: float) -> None:
    """With y = .5 x1 the states that y does not fix are integrated, whatever rounds to zero."""
    A, B = np.array([[0.5, 0.3, 0.0], [-0.2, 0.6, 0.0], [0.4, 0.1, 0.8]]), np.array([[1.0], [0.3], [0.7]])
    C = np.array([[factor, 0.0, 0.0]])
    nothing = np.zeros((3, 0))
    plant = General(A=A, B=B, C=C, D=np.zeros((1, 1)), E=nothing, G=np.zeros((1, 0)))
    history = History((plant.experiment(np.random.default_rng(0), 200),), 0.1)
    made = design("reduced_order", history, {})
    assert isinstance(made.observer, LinearObserver), made.verdict
    assert np.max(np.abs(made.observer.M)) < 10.0
    assert error_on(made, plant.experiment(np.random.default_rng(1), 40)) < 1e-10


@pytest.mark.parametrize("kind", KINDS)
def test_feedthrough_is_found_and_taken_out(kind: str) -> None:
    """An output y = x + [.3, 0, 0] u leaves no residual of its own."""
    A = np.array([[0.5, 0.3, 0.0], [-0.2, 0.6, 0.0], [0.4, 0.1, 0.8]])
    D = np.array([[0.3], [0.0], [0.0]])
    plant = General(A=A, B=np.ones((3, 1)), C=np.eye(3), D=D, E=np.array([[1.0], [0.0], [0.5]]), G=np.zeros((3, 1)))
    made = design(kind, History((plant.experiment(np.random.default_rng(0), 60),), 0.1), {})
    assert "known inputs act on y[0] directly" in str(made.certificate.to_json())
    assert error_on(made, plant.experiment(np.random.default_rng(1), 60, size=50.0)) < 1e-11


def test_noise_of_one_output_leaves_the_other_rows_alone() -> None:
    """C is rounded row by row: noise on y[0] changes no entry of C in the other rows, and is told of."""
    generator = np.random.default_rng(0)
    A, E = np.array([[0.9, 0.1, 0.0], [0.0, 0.7, 0.2], [0.1, 0.0, 0.5]]), np.array([[1.0], [0.5], [0.2]])
    C = np.array([[1.0, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 1.0]])
    plant = General(A=A, B=np.zeros((3, 0)), C=C, D=np.zeros((3, 0)), E=E, G=np.zeros((3, 1)))
    one = plant.experiment(generator, 200)
    noisy = replace(one, y=one.y + np.array([1e-2, 0.0, 0.0]) * generator.standard_normal(one.y.shape))
    made = design("full_order", History((noisy,), 0.1), {})
    assert made.certificate.matrices is not None, made.verdict
    assert np.allclose(made.certificate.matrices["C"][1:], C[1:], rtol=1e-9)
    assert made.certificate.data is not None
    assert "y[0] carries noise of" in made.certificate.data.rank_reason


def test_an_output_that_follows_nothing_is_refused_with_the_figure() -> None:
    """A column of other data is named with how much of it is unexplained."""
    generator = np.random.default_rng(0)
    x = generator.standard_normal((60, 2))
    for step in range(59):
        x[step + 1] = 0.5 * x[step] + 0.1 * x[step, ::-1]
    x += np.outer(np.sin(np.arange(60.0)), [1.0, 0.3])
    y = np.column_stack([x[:, 0], generator.standard_normal(60)])
    verdict = design("full_order", single(np.zeros((60, 0)), y, x, 0.1), {}).verdict
    assert "y[1] = C x + D u leaves" in verdict
    assert "% of its spread unexplained" in verdict


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("kind", KINDS)
def test_an_input_that_reaches_outputs_alone_is_no_noise(kind: str, seed: int) -> None:
    """It moves no state, and every output in proportion: found as an unknown input, and the estimate is exact."""
    generator = np.random.default_rng(seed)
    A = generator.standard_normal((3, 3))
    plant = General(
        A=0.6 * A / np.max(np.abs(np.linalg.eigvals(A))),
        B=generator.standard_normal((3, 1)),
        C=generator.standard_normal((5, 3)),
        D=np.zeros((5, 1)),
        E=np.hstack([generator.standard_normal((3, 1)), np.zeros((3, 1))]),
        G=np.hstack([np.zeros((5, 1)), 0.3 * generator.standard_normal((5, 1))]),
    )
    made = design(kind, History((plant.experiment(generator, 80),), 0.1), FAST)
    assert made.accepted, made.verdict
    assert made.certificate.proof is not None
    assert (made.certificate.proof.worst_error or 0.0) < 1e-9
