"""How large an attack is: reconstructed next to arbitrary inputs, or with inputs that stay calm."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from monitor import input_estimators
from monitor.attack_size import Spans, noise_response, reconstruct, under_hypothesis, with_calm_inputs
from monitor.errors import HistoryError
from monitor.history import Experiment, History

A = np.array([[-0.28837, 0.10333, 5.39842], [-0.40767, -0.33421, 1.71161], [-0.00055, -0.00072, 0.95996]])
E = np.array([[-0.24792, 0.04004], [1.28837, 0.01188], [0.00179, 0.0098]])  # DGU 1, theory.md section 3
MEAN = np.array([11.0, 50.0])
STEADY = np.linalg.solve(np.eye(3) - A, E @ MEAN)
SPANS = Spans(calm=(20, 150), attack=(150, 200))
Floats = NDArray[np.float64]


def run(steps: int, spread: float, noise: float, seed: int) -> tuple[Floats, Floats]:
    """Outputs with noise and the inputs MEAN + U(-spread, spread), from the steady state of MEAN."""
    generator = np.random.default_rng(seed)
    d = MEAN + spread * generator.uniform(-1.0, 1.0, (steps, 2))
    rows = [STEADY]
    for one in d[:-1]:
        rows.append(A @ rows[-1] + E @ one)
    return np.array(rows) + noise * generator.standard_normal((steps, 3)), d


def history(outputs: int = 3) -> History:
    """Sixty exact samples with the applied inputs."""
    x, d = run(60, 1.0, 0.0, 1)
    return History((Experiment(np.empty((60, 0)), x[:, :outputs], x, 0.01, d),), 0.01)


@pytest.mark.parametrize("channel", [0, 1, 2])
def test_one_false_output_is_measured_whatever_the_inputs_do(channel: int) -> None:
    """Phi of any shape comes back at its own instant; the inputs under the true hypothesis are the applied ones."""
    y, d = run(200, 5.0, 0.0, 2)
    phi = np.zeros(200)
    phi[150:] = 0.1 + 0.05 * np.sin(np.arange(50.0))
    y[:, channel] += phi
    found = under_hypothesis(history(), channel, y, np.ones(200, dtype=np.bool_), SPANS)
    np.testing.assert_allclose(found.attack[100:199], phi[100:199], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(found.inputs[100:199], d[100:199], rtol=0.0, atol=1e-6)
    assert found.magnitude == pytest.approx(phi[150:199].mean(), abs=1e-6)
    assert np.isnan(found.attack[199])  # one step late: the last instant is not known yet


def test_the_uncertainty_is_that_of_the_noise() -> None:
    """Two standard deviations of calm estimates agree with the noise gain to 20 %, and cover the error."""
    y, _ = run(200, 1.0, 1e-3, 3)
    y[150:, 0] += 0.1
    found = under_hypothesis(history(), 0, y, np.ones(200, dtype=np.bool_), SPANS)
    assert found.uncertainty == pytest.approx(2e-3 * found.noise_gain, rel=0.2)
    assert abs(found.magnitude - 0.1) < found.uncertainty


def test_two_outputs_leave_no_room_for_an_attack() -> None:
    """P = m_d: refused by the rank condition, every number NaN."""
    y, _ = run(200, 1.0, 0.0, 2)
    found = under_hypothesis(history(2), 0, y[:, :2], np.ones(200, dtype=np.bool_), SPANS)
    assert "no exact decoupling" in found.verdict
    assert np.isnan([found.magnitude, found.uncertainty]).all()


def test_the_whole_vector_is_measured_while_inputs_stay_calm() -> None:
    """(.1, -.2, .05) on all outputs at once, inputs that vary by .01: within the stated uncertainty, which is small."""
    y, d = run(200, 0.01, 0.0, 4)
    phi = np.array([0.1, -0.2, 0.05])
    y[150:] += phi
    calm = Spans(calm=(20, 148), attack=(150, 200))
    found = with_calm_inputs(history(), d, y, calm, 10)
    assert found.samples == 10
    assert np.all(np.abs(found.magnitude - phi) <= found.uncertainty)
    assert np.all(found.uncertainty < 0.1)


def test_the_whole_vector_needs_every_state() -> None:
    """With V and I_t only the model cannot run on."""
    y, d = run(200, 0.01, 0.0, 4)
    with pytest.raises(HistoryError, match="2 outputs of 3 states"):
        with_calm_inputs(history(2), d, y[:, :2], SPANS, 10)


def test_missing_samples_restart_the_estimator() -> None:
    """A gap costs the start and nothing later."""
    y, d = run(200, 1.0, 0.0, 5)
    estimator = input_estimators.design("delayed", history(), {}).estimator
    assert estimator is not None
    delivered = np.ones(200, dtype=np.bool_)
    delivered[80:83] = False
    found = reconstruct(estimator, y, delivered)
    assert np.isnan(found[79:82]).all()
    np.testing.assert_allclose(found[130:199], d[130:199], rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(("kind", "outputs"), [("delayed", 3), ("cl_uie", 2), ("delayed", 1)])
def test_noise_response_is_what_noise_does(kind: str, outputs: int) -> None:
    """Unequal noise on the outputs spreads the inputs as predicted, to 10 % (4000 samples), operating point or not."""
    options: dict[str, object] = {"delay": 2} if outputs == 1 else {}
    estimator = input_estimators.design(kind, history(outputs), options).estimator
    assert estimator is not None
    std = np.array([1e-3, 5e-3, 1e-4])[:outputs]
    calm = np.tile(STEADY[:outputs], (4100, 1))
    noisy = calm + std * np.random.default_rng(6).standard_normal(calm.shape)
    sure = np.ones(4100, dtype=np.bool_)
    spread = (reconstruct(estimator, noisy, sure) - reconstruct(estimator, calm, sure))[100:4090].std(axis=0)
    predicted = np.linalg.norm(noise_response(estimator) * std, axis=1)
    np.testing.assert_allclose(spread, predicted, rtol=0.1)
