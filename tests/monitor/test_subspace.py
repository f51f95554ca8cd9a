"""Finding the behaviour in noisy, rounded and drifting data."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.linalg import null_space, subspace_angles

from monitor.errors import HistoryError
from monitor.history import Experiment, History, data_matrices
from monitor.observers import LinearObserver, design
from monitor.subspace import METHODS, Method, averaged, span
from monitor.subspace.structured import _whiten

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.monitor.conftest import Plant, RandomCase


def _angle(plant: Plant, history: History, method: Method) -> float:
    """Largest angle between the parity rows found and the true ones, Q [B A E-free] as [x_t; x_t+1; u_t]."""
    n, m_d = plant.E.shape
    behaviour = span(data_matrices(history), m_d, method, np.ones(n))
    found = null_space(np.vstack([behaviour.L_x, behaviour.L_xf, behaviour.L_u, behaviour.L_uf]).T)
    free = null_space(plant.E.T)  # q' E = 0
    true = np.vstack([-plant.A.T @ free, free, -plant.B.T @ free, np.zeros((plant.B.shape[1], free.shape[1]))])
    return float(np.max(subspace_angles(found, true)))


@pytest.mark.parametrize("method", METHODS)
def test_all_methods_agree_on_exact_data(random_cases: list[RandomCase], method: Method) -> None:
    """Without noise every method finds the true parity rows, known inputs included."""
    for case in random_cases[:40]:
        if 0 < case.plant.E.shape[1] < len(case.plant.A):
            assert _angle(case.plant, case.history, method) < 1e-6, case.seed


def test_parity_direction_of_the_page(dgu: Callable[[int], Plant]) -> None:
    """From 400 samples with noise 1e-3 the parity direction agrees with the true one to 2e-6 (theory, section 3)."""
    plant = dgu(1)
    found = []
    for seed in range(20):
        history = plant.history(np.random.default_rng(seed), samples=400, mean=(11.0, 50.0), noise_std=1e-3)
        found.append(1.0 - np.cos(_angle(plant, history, Method.STRUCTURED)))
    assert np.median(found) < 2e-6


def test_structured_is_at_least_as_good_as_total_least_squares(dgu: Callable[[int], Plant]) -> None:
    """Knowing that every sample appears in two columns pays on average."""
    ratios = []
    for number in range(1, 7):
        for seed in range(5):
            generator = np.random.default_rng(seed)
            history = dgu(number).history(generator, samples=200, mean=(11.0, 50.0), noise_std=1e-2)
            angles = [_angle(dgu(number), history, one) for one in (Method.STRUCTURED, Method.TOTAL_LEAST_SQUARES)]
            ratios.append(angles[0] / angles[1])
    assert np.exp(np.mean(np.log(ratios))) < 1.0


def test_whitening_matches_the_full_covariance() -> None:
    """The banded factor gives s' Gamma^-1 s of the dense moving-average covariance, broken where columns are lost."""
    generator = np.random.default_rng(0)
    c, n, N = 2, 3, 5
    P_p, P_f, s = (generator.standard_normal(shape) for shape in ((c, n), (c, n), (c, N)))
    joined = np.array([True, True, False, True])
    dense = np.kron(np.eye(N), P_p @ P_p.T + P_f @ P_f.T)
    for t in np.flatnonzero(joined):
        later, earlier = slice(c * (t + 1), c * (t + 2)), slice(c * t, c * (t + 1))
        dense[later, earlier], dense[earlier, later] = P_p @ P_f.T, (P_p @ P_f.T).T
    flat = s.T.ravel()
    assert np.isclose(np.sum(_whiten(s, P_p, P_f, joined) ** 2), flat @ np.linalg.solve(dense, flat), rtol=1e-12)


def test_averaging_halves_noise_of_four_repetitions(dgu: Callable[[int], Plant]) -> None:
    """The mean of four repetitions carries half the noise; other lengths are no repetitions."""
    generator = np.random.default_rng(0)
    exact = dgu(1).history(generator, samples=300, mean=(11.0, 50.0)).experiments[0]
    noisy = [exact.x + 1e-2 * generator.standard_normal(exact.x.shape) for _ in range(4)]
    history = History(tuple(Experiment(exact.u, x, x) for x in noisy), 0.01)
    # The standard error of a standard deviation from 900 numbers is 2.4 %.
    assert np.std(averaged(history).experiments[0].x - exact.x) == pytest.approx(5e-3, rel=0.1)
    shorter = Experiment(exact.u[:-1], exact.y[:-1], exact.x[:-1])
    with pytest.raises(HistoryError, match=r"\[299, 300\] samples, expected the same number in each"):
        averaged(History((exact, shorter), 0.01))


def _sees_a_bias(observer: LinearObserver) -> bool:
    gain = observer.J + observer.H @ np.linalg.solve(np.eye(observer.order) - observer.A, observer.B)
    return bool(np.linalg.norm(gain, 2) > 0.05)


@pytest.mark.parametrize("number", range(1, 7))
@pytest.mark.parametrize("disturbed", ["adc", "drift", "gaps", "short experiments"])
def test_real_data(dgu: Callable[[int], Plant], number: int, disturbed: str) -> None:
    """A 12-bit converter, a drifting operating point, missing samples and short experiments: right rank or refused."""
    generator = np.random.default_rng(number)
    plant = dgu(number)
    history = plant.history(generator, samples=120, mean=(11.0, 50.0))
    if disturbed == "short experiments":
        history = plant.history(generator, samples=6, experiments=20, mean=(11.0, 50.0))
    x = history.experiments[0].x.copy()
    if disturbed == "adc":
        step = np.array([100.0, 50.0, 25.0]) / 2**12  # full scale over 12 bits, V, A, V s
        x = step * np.round(x / step)
    if disturbed == "drift":
        d = np.array([11.0, 50.0]) + generator.uniform(-1.0, 1.0, (120, 2)) + np.linspace(0.0, 10.0, 120)[:, None]
        x = plant.run(x[0], np.zeros((120, 0)), d)[1]
    if disturbed == "gaps":
        x[generator.uniform(size=120) < 0.1] = np.nan
    if disturbed != "short experiments":
        history = History((Experiment(np.zeros((120, 0)), x, x),), 0.01)
    for options in ({}, {"unknown_inputs": 2}):
        made = design("full_order", history, options)
        if isinstance(made.observer, LinearObserver):
            assert made.certificate.data is not None
            assert made.certificate.data.unknown_inputs == 2
            assert _sees_a_bias(made.observer)
        else:
            assert disturbed == "adc"
            assert "give unknown_inputs or noise_std" in made.verdict or "too noisy" in made.verdict


def test_missing_samples_cost_nothing_but_columns(dgu: Callable[[int], Plant]) -> None:
    """A history with gaps gives the same observer as one without."""
    whole = dgu(1).history(np.random.default_rng(0), samples=60, mean=(11.0, 50.0))
    x = whole.experiments[0].x.copy()
    x[[7, 20, 21]] = np.nan
    gaps = design("full_order", replace(whole, experiments=(replace(whole.experiments[0], x=x),)), {})
    made = design("full_order", whole, {})
    assert gaps.certificate.data is not None
    assert gaps.certificate.data.dropped == 5
    assert isinstance(gaps.observer, LinearObserver)
    assert isinstance(made.observer, LinearObserver)
    assert np.allclose(gaps.observer.D, made.observer.D, rtol=0.0, atol=1e-8)
