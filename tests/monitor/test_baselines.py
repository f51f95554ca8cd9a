"""Model-based baselines: each does what its textbook says, and none is reachable from the data-driven path."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from monitor.baselines import (
    Model,
    decoupling_gains,
    identified,
    identify_then_design,
    kalman,
    luenberger,
    model_based_uio,
)
from monitor.errors import MonitorError

if TYPE_CHECKING:
    from collections.abc import Callable

    from monitor.history import History
    from monitor.observers import LinearObserver
    from tests.monitor.conftest import Plant

MONITOR = Path(__file__).parents[2] / "monitor"


def _model(plant: Plant) -> Model:
    return Model(A=plant.A, B=plant.B, E=plant.E, C=plant.C)


def _run(observer: LinearObserver, u: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residuals and estimates (steps, .)."""
    state = observer.init(tuple(u[0]), tuple(y[0] + 1.0))
    estimates, residuals = [], []
    for known, output in zip(u, y, strict=True):
        state, found = observer.step(state, tuple(known), tuple(output))
        estimates.append(np.array(found.estimate))
        residuals.append(np.array(found.residual))
    return np.array(residuals), np.array(estimates)


@pytest.mark.parametrize("number", range(1, 7))
def test_luenberger_converges_when_all_inputs_are_known(dgu: Callable[[int], Plant], number: int) -> None:
    """With load and reference told, the error dies out at the requested decay."""
    plant, d = dgu(number), np.random.default_rng(0).uniform(0.0, 50.0, (80, 2))
    y, x = plant.run(np.array([40.0, 5.0, 8.0]), np.zeros((80, 0)), d)
    observer = luenberger(_model(plant), 0.5)
    assert np.max(np.abs(np.linalg.eigvals(observer.A))) <= 0.5
    residuals, estimates = _run(observer, d, y)
    assert np.allclose(estimates[-1], x[-1], atol=1e-9)
    assert np.allclose(residuals[-1], 0.0, atol=1e-9)


def test_kalman_innovations_are_white_with_the_riccati_covariance(dgu: Callable[[int], Plant]) -> None:
    """On its own model the innovation has covariance C P C' + R and no memory."""
    plant, generator = dgu(1), np.random.default_rng(0)
    std_d, std_y, steps = np.array([1.0, 1.0]), np.full(3, 0.5), 20_000
    mean = np.tile([11.0, 50.0], (steps, 1))
    y, _ = plant.run(np.array([50.0, 11.0, 11.0]), np.zeros((steps, 0)), mean + generator.standard_normal((steps, 2)))
    observer = kalman(_model(plant), std_d, std_y)
    residuals, _ = _run(observer, mean, y + 0.5 * generator.standard_normal(y.shape))
    residuals = residuals[100:]
    # C P C' + R from the filter's own gain: A P C' = L S and P = A P A' + Q - L S L'.
    spread = residuals.T @ residuals / len(residuals)
    P = spread - np.diag(std_y**2)
    gain = observer.B[:, 2:]
    riccati = plant.A @ P @ plant.A.T + plant.E @ plant.E.T - gain @ spread @ gain.T
    # 20 000 samples: a covariance of size 2 is known to about 0.02.
    assert np.allclose(riccati, P, atol=0.1)
    memory = residuals[1:].T @ residuals[:-1] / len(residuals)
    assert np.max(np.abs(memory)) < 0.1


def test_identified_model_is_the_plant_on_exact_data(dgu: Callable[[int], Plant]) -> None:
    """A exactly, E up to a factor on its right."""
    plant = dgu(1)
    model = identified(plant.history(np.random.default_rng(0), samples=20), 2)
    # With d of mean zero least squares still errs by the sample correlation of d with x: range E is exact, A is not.
    parity = np.linalg.svd(plant.E)[0][:, 2]
    assert np.allclose(parity @ model.E, 0.0, atol=1e-9)
    assert np.allclose(parity @ model.A, parity @ plant.A, atol=1e-9)


@pytest.mark.parametrize("number", range(1, 7))
def test_identify_then_design_decouples_on_exact_data(
    dgu: Callable[[int], Plant], dgu_history: Callable[..., History], number: int
) -> None:
    """The two-step way gives an observer whose error forgets its start whatever d does."""
    d = np.random.default_rng(0).uniform(-10.0, 60.0, (80, 2))
    y, x = dgu(number).run(np.array([40.0, 5.0, 8.0]), np.zeros((80, 0)), d)
    _, estimates = _run(identify_then_design(dgu_history(number), 2, 0.5), np.zeros((80, 0)), y)
    assert np.allclose(estimates[-1], x[-1], atol=1e-8)


def test_model_based_uio_decouples(dgu: Callable[[int], Plant]) -> None:
    """The textbook observer forgets its start whatever d does."""
    plant = dgu(2)
    d = np.random.default_rng(0).uniform(-10.0, 60.0, (80, 2))
    y, x = plant.run(np.array([40.0, 5.0, 8.0]), np.zeros((80, 0)), d)
    model = _model(plant)
    _, estimates = _run(model_based_uio(model, decoupling_gains(model, 0.5)), np.zeros((80, 0)), y)
    assert np.allclose(estimates[-1], x[-1], atol=1e-8)


def test_impossible_decoupling_and_shapes() -> None:
    """The violated condition is named."""
    eye = np.eye(3)
    hidden = Model(A=0.5 * eye, B=np.zeros((3, 0)), E=eye[:, 2:], C=eye[:2])
    with pytest.raises(MonitorError, match="rank CE < rank E"):
        decoupling_gains(hidden, 0.5)
    with pytest.raises(MonitorError, match=r"the model has A \(3, 3\), B \(2, 0\)"):
        Model(A=eye, B=np.zeros((2, 0)), E=eye, C=eye)


def test_no_data_driven_module_imports_a_baseline() -> None:
    """What a monitor uses never sees a model."""
    for path in MONITOR.rglob("*.py"):
        if "baselines" in path.parts:
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            assert not any("baselines" in name for name in names), path
