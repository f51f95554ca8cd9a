"""Full and reduced order on 200 random plants: existence, decoupling, and equality with the model-based solution."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from monitor.acceptor import Acceptors, regress, solve
from monitor.baselines import Model, decoupling_gains, model_based_uio
from monitor.behaviour import Behaviour
from monitor.history import data_matrices
from monitor.observers import LinearObserver, design
from monitor.observers.full_order import _SHAPE as FULL
from monitor.observers.reduced_order import _SHAPE as REDUCED
from monitor.subspace import Method, span

if TYPE_CHECKING:
    from monitor.observers import Design
    from tests.monitor.conftest import Plant, RandomCase

KINDS = ("full_order", "reduced_order")
# The slowest movable mode may stay just inside the circle: existence is the question, not speed.
STABILISE: dict[str, object] = {"strategy": "dual_lqr", "decay": 0.99999, "allow_blind": True}
SHAPES = {"full_order": FULL, "reduced_order": REDUCED}


@pytest.fixture(scope="module", params=KINDS)
def stabilised(request: pytest.FixtureRequest, random_cases: list[RandomCase]) -> list[tuple[RandomCase, Design]]:
    """All cases with their designs, of one order after the other."""
    return [(case, design(request.param, case.history, STABILISE)) for case in random_cases]


def test_existence_is_decided_as_the_model_decides_it(stabilised: list[tuple[RandomCase, Design]]) -> None:
    """A design comes out exactly when rank CE = rank E and no zero is unstable, for both orders alike."""
    wrong = [(case.seed, case.exists, made.verdict) for case, made in stabilised if made.accepted != case.exists]
    assert not wrong


def test_both_answers_occur(random_cases: list[RandomCase]) -> None:
    """The random plants ask the question in earnest."""
    assert 20 < sum(case.exists for case in random_cases) < 180


def test_refusals_name_the_violated_condition(stabilised: list[tuple[RandomCase, Design]]) -> None:
    """Every refusal on exact data says which of the two conditions fails."""
    for case, made in stabilised:
        if not case.exists:
            assert "T (13) fails (rank CE < rank E)" in made.verdict or "unstable zeros" in made.verdict


def test_error_is_autonomous_under_arbitrary_inputs(stabilised: list[tuple[RandomCase, Design]]) -> None:
    """Whatever u and d do, the error of the integrated states is A_UIO^t e_0 and the observer is Schur."""
    for case, made in stabilised:
        if isinstance(made.observer, LinearObserver):
            assert made.certificate.dynamics is not None
            assert made.certificate.dynamics.spectral_radius < 1.0
            _check_error(case.plant, made.observer, np.random.default_rng(case.seed))


def _check_error(plant: Plant, observer: LinearObserver, generator: np.random.Generator) -> None:
    """Run 15 steps (unstable plants stay in range): the difference to a right start obeys z+ = A z alone."""
    steps, n, m, m_d = 15, len(plant.A), plant.B.shape[1], plant.E.shape[1]
    u, d = generator.standard_normal((steps, m)), 10.0 * generator.standard_normal((steps, m_d))
    y, x = plant.run(generator.standard_normal(n), u, d)
    state = np.array(observer.init(tuple(u[0]), tuple(y[0])))
    right = np.linalg.lstsq(observer.M, x[0] - observer.D @ np.concatenate([u[0], y[0]]), rcond=None)[0]
    first_residual = observer.H @ right + observer.J @ np.concatenate([u[0], y[0]])
    # The reduced order keeps the last step's prediction beside its states: a right start predicts y_0.
    right = right - np.linalg.pinv(observer.H) @ first_residual
    error = state - right
    scale = 1.0 + np.max(np.abs(x))
    for step in range(steps):
        running, output = observer.step(tuple(state), tuple(u[step]), tuple(y[step]))
        estimate, residual = np.array(output.estimate), np.array(output.residual)
        # 1e-7 of the largest state: rounding of an observer identified from data of that size.
        assert np.allclose(estimate - x[step], observer.M @ error, rtol=0.0, atol=1e-7 * scale)
        if step:
            assert np.allclose(residual, observer.H @ error, rtol=0.0, atol=1e-7 * scale)
        state, error = np.array(running), observer.A @ error


def _from_model(plant: Plant) -> Behaviour:
    """The behaviour that infinitely much data would show."""
    n, m, m_d = len(plant.A), plant.B.shape[1], plant.E.shape[1]
    L = np.zeros((2 * n + 2 * m, 2 * m + n + m_d))
    L[:m, :m], L[m : m + n, m : m + n], L[m + n : 2 * m + n, m + n : 2 * m + n] = np.eye(m), np.eye(n), np.eye(m)
    L[2 * m + n :] = np.hstack([plant.B, plant.A, np.zeros((n, m)), plant.E])
    L = np.linalg.qr(L)[0]
    L_u, L_x, L_uf, L_xf = np.split(L, [m, m + n, 2 * m + n])
    return Behaviour(L_u=L_u, L_x=L_x, L_uf=L_uf, L_xf=L_xf, C=plant.C, unknown_inputs=m_d)


def _acceptors(behaviour: Behaviour, kind: str) -> Acceptors:
    solved = solve(regress(behaviour, SHAPES[kind].selection(behaviour)), 1e-9)
    assert solved is not None
    return solved


@pytest.mark.parametrize("kind", KINDS)
def test_least_norm_solution_is_that_of_the_model(random_cases: list[RandomCase], kind: str) -> None:
    """T's solution from data and from the matrices agree to 1e-8 (T, remark 11)."""
    for case in random_cases:
        if not case.exists:
            continue
        n, m_d = case.plant.E.shape
        behaviour = span(data_matrices(case.history), m_d, Method.TOTAL_LEAST_SQUARES, np.ones(n))
        data, model = _acceptors(behaviour, kind), _acceptors(_from_model(case.plant), kind)
        scale = max(1.0, float(np.max(np.abs(model.W0), initial=0.0)))
        assert np.allclose(data.W0, model.W0, rtol=0.0, atol=1e-8 * scale)


def test_every_model_based_observer_is_among_the_data_driven_ones(random_cases: list[RandomCase]) -> None:
    """For random freedom Y and K of the model-based observer some Q gives its very matrices, to 1e-8."""
    for case in random_cases:
        if not case.exists:
            continue
        plant, generator = case.plant, np.random.default_rng(case.seed)
        (n, m_d), p = plant.E.shape, len(plant.C)
        model = Model(A=plant.A, B=plant.B, E=plant.E, C=plant.C)
        expected = model_based_uio(model, decoupling_gains(model, 0.99999, generator.standard_normal((n, p))))
        behaviour = span(data_matrices(case.history), m_d, Method.TOTAL_LEAST_SQUARES, np.ones(n))
        acceptors = _acceptors(behaviour, "full_order")
        W = np.hstack([expected.B - expected.A @ expected.D, expected.A, expected.D])  # T (14) backwards
        Q = (W - acceptors.W0) @ acceptors.N.T
        found = FULL.observer(behaviour, acceptors, acceptors.W0 + Q @ acceptors.N)
        for name in "ABDHJ":
            wanted = getattr(expected, name)
            scale = max(1.0, float(np.max(np.abs(wanted), initial=0.0)))
            assert np.allclose(getattr(found, name), wanted, rtol=0.0, atol=1e-8 * scale), (case.seed, name)
