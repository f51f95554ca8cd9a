"""What a certificate predicts is what a simulation of the observer shows, to 1 %."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

from monitor.observers import LinearObserver, design
from monitor.wording import describe

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from monitor.certificate import ResidualReport
    from monitor.history import History
    from monitor.observers import Design
    from tests.monitor.conftest import Plant, RandomCase

ONE_PERCENT = 0.01
STRATEGIES = ("minimum_norm", "dual_lqr", "pole_placement", "max_sensitivity")


def _response(observer: LinearObserver, phi: np.ndarray) -> np.ndarray:
    """Residuals (steps, p, runs) under phi (steps, p, runs) added to a plant at rest."""
    state = np.zeros((observer.order, phi.shape[2]))
    B, J = observer.B[:, observer.inputs :], observer.J[:, observer.inputs :]
    rows = []
    for sample in phi:
        rows.append(observer.H @ state + J @ sample)
        state = observer.A @ state + B @ sample
    return np.array(rows)


def _steps(made: Design) -> int:
    """Steps after which less than 1e-6 of any transient is left (three decays to 1 %)."""
    assert made.certificate.dynamics is not None
    return 3 * (made.certificate.dynamics.convergence_steps or 0) + 5


def _check_bias(observer: LinearObserver, report: ResidualReport, steps: int) -> None:
    """Constant biases: steady and peak gains, invisible directions, smallest bias at the threshold."""
    p = observer.outputs
    response = _response(observer, np.repeat(np.eye(p)[None], steps, axis=0))
    scale = max(float(np.max(np.abs(report.peak_gain))), 1e-9)
    assert np.allclose(response[-1], report.dc_gain, rtol=0.0, atol=ONE_PERCENT * scale)
    assert np.allclose(np.max(np.abs(response), axis=0), report.peak_gain, rtol=ONE_PERCENT, atol=1e-5 * scale)
    if report.invisible_bias.shape[1]:
        hidden = _response(observer, np.repeat(report.invisible_bias[None], steps, axis=0))
        assert np.max(np.abs(hidden[-1])) <= 1e-5 * scale
    seen = np.isfinite(report.smallest_bias)
    bias = np.diag(np.where(seen, report.smallest_bias, 0.0))
    for factor, crosses in ((1.0 + ONE_PERCENT, True), (1.0 - ONE_PERCENT, False)):
        alarm = np.abs(_response(observer, np.repeat(factor * bias[None], steps, axis=0))) > report.threshold[:, None]
        assert np.array_equal(alarm.any(axis=(0, 1))[seen], np.full(np.count_nonzero(seen), crosses))


def _check_noise(observer: LinearObserver, report: ResidualReport, steps: int) -> None:
    """The covariance under unit white noise is the sum over the impulse response."""
    impulse = np.zeros((steps, observer.outputs, observer.outputs))
    impulse[0] = np.eye(observer.outputs)
    response = _response(observer, impulse)
    covariance = np.einsum("tij,tkj->ik", response, response)
    scale = max(float(np.max(np.abs(report.noise_gain))), 1e-12)
    assert np.allclose(covariance, report.noise_gain, rtol=0.0, atol=ONE_PERCENT * scale)


def _checked(designs: Iterable[Design]) -> int:
    count = 0
    for made in designs:
        report = made.certificate.residual
        if not isinstance(made.observer, LinearObserver) or report is None:
            continue
        if report.blind:
            assert np.max(np.abs(report.dc_gain)) < 1e-6
            continue
        _check_bias(made.observer, report, _steps(made))
        _check_noise(made.observer, report, _steps(made))
        count += 1
    return count


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_six_dgus(dgu_history: Callable[..., History], strategy: str) -> None:
    """All six DGUs, every strategy."""
    options = {"strategy": strategy}
    assert _checked(design("full_order", dgu_history(number), options) for number in range(1, 7)) == 6


def test_six_dgus_from_noisy_histories(dgu_history: Callable[..., History]) -> None:
    """A design from noisy data certifies itself, not the plant it aimed at."""
    made = (design("full_order", dgu_history(one, noise_std=1e-3), {"unknown_inputs": 2}) for one in range(1, 7))
    assert _checked(made) == 6


@pytest.mark.parametrize("kind", ["full_order", "reduced_order"])
def test_random_plants(random_cases: list[RandomCase], kind: str) -> None:
    """200 random plants, wherever an observer exists and settles in reasonable time."""
    options = {"strategy": "dual_lqr", "decay": 0.9}
    assert _checked(design(kind, case.history, options) for case in random_cases) > 50


@pytest.mark.parametrize("number", range(1, 7))
def test_invisible_plane_of_a_dgu_is_that_of_its_model(dgu_history: Callable[..., History], number: int) -> None:
    """(k1 - 1) phi_V + (k2 - R_t) phi_I + k3 phi_v = 0 describes the biases without steady residual (theory, 3)."""
    gains = {
        1: (-3.134, -0.363, 13.553),
        2: (-1.869, -0.35, 48.285),
        3: (-1.48, -0.208, 30.673),
        4: (-7.99, -0.675, 102.96),
        5: (-1.101, -0.41, 16.393),
        6: (-3.134, -0.763, 13.553),
    }
    report = design("full_order", dgu_history(number), {}).certificate.residual
    assert report is not None
    assert report.invisible_bias.shape == (3, 2)
    assert np.allclose(np.array(gains[number]) @ report.invisible_bias, 0.0, atol=1e-6)
    assert (report.residual_rank, report.stealthy_inputs) == (1, 2)


def test_stealthy_trajectory_of_the_page(dgu: Callable[[int], Plant], dgu_history: Callable[..., History]) -> None:
    """phi+ = A phi + E delta from rest leaves no residual while it grows (theory, section 3)."""
    plant = dgu(1)
    made = design("full_order", dgu_history(1), {})
    assert isinstance(made.observer, LinearObserver)
    phi = np.zeros((50, 3, 1))
    for step in range(49):
        phi[step + 1, :, 0] = plant.A @ phi[step, :, 0] + plant.E @ np.array([0.1, 0.1])
    assert np.max(np.abs(phi)) > 0.05
    assert np.max(np.abs(_response(made.observer, phi))) < 1e-10


def test_noise_covariance_by_monte_carlo(dgu_history: Callable[..., History]) -> None:
    """White noise in 1000 runs of 400 steps spreads the residual as certified."""
    made = design("full_order", dgu_history(1), {})
    assert isinstance(made.observer, LinearObserver)
    assert made.certificate.residual is not None
    noise = np.random.default_rng(0).standard_normal((400, 3, 1000))
    residual = _response(made.observer, noise)[20:]
    covariance = np.einsum("tir,tjr->ij", residual, residual) / (380 * 1000)
    # The standard error of a variance from 380 000 samples is 0.23 %.
    assert np.allclose(covariance, made.certificate.residual.noise_gain, rtol=0.0, atol=ONE_PERCENT)


@pytest.mark.parametrize("number", range(1, 7))
def test_max_sensitivity_sees_more_at_equal_noise(dgu_history: Callable[..., History], number: int) -> None:
    """At the noise gain of minimum_norm the visible bias leaves several times the residual."""
    plain = design("full_order", dgu_history(number), {}).certificate.residual
    best = design("full_order", dgu_history(number), {"strategy": "max_sensitivity"}).certificate.residual
    assert plain is not None
    assert best is not None
    # The programme may use the budget up; 1e-6 is the solver's accuracy.
    assert np.trace(best.noise_gain) <= np.trace(plain.noise_gain) * (1.0 + 1e-6)
    assert np.linalg.norm(best.dc_gain, 2) > 3.0 * np.linalg.norm(plain.dc_gain, 2)


def test_json_and_words(dgu_history: Callable[..., History]) -> None:
    """The JSON document holds every part with finite numbers; the words begin with the verdict."""
    certificate = design("full_order", dgu_history(1), {}).certificate
    document = json.loads(certificate.to_json())
    parts = {"data", "dynamics", "residual", "proof", "matrices", "lag", "guarantee", "method"}
    assert set(document) == {"kind", "accepted", "verdict", *parts}
    assert document["data"]["rank"] == 5
    assert np.shape(document["matrices"]["A"]) == (3, 3)
    assert describe(certificate)[0] == f"full_order: {certificate.verdict}"
    assert any(line.startswith("smallest bias seen at thresholds 0.001") for line in describe(certificate))


def test_json_of_a_refusal(dgu_history: Callable[..., History]) -> None:
    """A refused design still tells what the data showed."""
    certificate = design("full_order", dgu_history(1), {"unknown_inputs": 1}).certificate
    document = json.loads(certificate.to_json())
    assert document["accepted"] is False
    assert document["residual"] is None
    assert len(document["data"]["innovation_values"]) == 3
