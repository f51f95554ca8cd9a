"""The unknown input one step late, from x_t+1 = A x_t + E d_t learned on a history."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from monitor import input_estimators
from monitor.errors import MonitorError
from monitor.history import Experiment, History

SAMPLES = 30


def _recorded(seed: int, n: int = 3, noise: float = 0.0) -> tuple[History, NDArray[np.float64], NDArray[np.float64]]:
    """A history of x+ = A x + E d, y = x, with two inputs, and the A and E behind it."""
    rng = np.random.default_rng(seed)
    A = rng.uniform(-1.0, 1.0, (n, n))
    A *= 0.9 / np.max(np.abs(np.linalg.eigvals(A)))
    E = np.linalg.qr(rng.standard_normal((n, 2)))[0]
    d = rng.uniform(-1.0, 1.0, (SAMPLES, 2)) + 5.0
    x = [rng.uniform(-1.0, 1.0, n)]
    for row in d[:-1]:
        x.append(A @ x[-1] + E @ row)
    states = np.array(x) + noise * rng.standard_normal((SAMPLES, n))
    return History((Experiment(np.empty((SAMPLES, 0)), states, states, 0.1, d),), 0.1), A, E


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_the_input_of_any_trajectory_comes_back_one_step_late(seed: int) -> None:
    """dhat_(t-1) = d_(t-1) on a new trajectory of the plant that the history shows, once the start has died out."""
    history, A, E = _recorded(seed)
    estimator = input_estimators.design("one_step", history, {}).estimator
    assert estimator is not None
    assert (estimator.inputs, estimator.outputs, estimator.lag) == (2, 3, 1)
    rng = np.random.default_rng(seed + 1)
    x, d = rng.uniform(-1.0, 1.0, 3), rng.uniform(-3.0, 3.0, (20, 2))
    state = estimator.init(x.tolist())
    found = []
    for row in d:
        state, dhat = estimator.step(state, x.tolist())
        found.append(dhat)
        x = A @ x + E @ row
    np.testing.assert_allclose(np.array(found)[10:], d[9:-1], atol=1e-6)


def test_a_missing_sample_makes_the_state_missing_and_a_new_start_works() -> None:
    """NaN spreads to the whole state, so that whoever steps the estimator sees that it must start again."""
    estimator = input_estimators.design("one_step", _recorded(1)[0], {}).estimator
    assert estimator is not None
    state, _ = estimator.step(estimator.init((1.0, 2.0, 3.0)), (float("nan"),) * 3)
    assert np.isnan(np.asarray(state)).all()
    state, dhat = estimator.step(estimator.init((1.0, 2.0, 3.0)), (1.0, 2.0, 3.0))
    assert np.isfinite([*state, *dhat]).all()


def test_floats_and_arrays_give_the_same_bits() -> None:
    """One link in floats and a batch of runs in arrays are the same computation."""
    estimator = input_estimators.design("one_step", _recorded(2)[0], {}).estimator
    assert estimator is not None
    outputs = np.random.default_rng(3).uniform(-1.0, 1.0, (5, 3, 4))
    batch = estimator.init(outputs[0])
    alone = [estimator.init(outputs[0, :, run].tolist()) for run in range(4)]
    for y in outputs:
        batch, dhat = estimator.step(batch, y)
        for run in range(4):
            alone[run], single = estimator.step(alone[run], y[:, run].tolist())
            assert [float(component[run]) for component in dhat] == list(single)  # type: ignore[index]


def test_noisy_histories_estimate_with_their_noise() -> None:
    """With noise 1e-4 on the history, the input comes back within a few per cent of its size."""
    history, A, E = _recorded(4, noise=1e-4)
    found = input_estimators.design("one_step", history, {"observer_options": {"unknown_inputs": 2}})
    assert found.estimator is not None, found.verdict
    x, d = np.ones(3), np.array([1.0, -2.0])
    state = found.estimator.init(x.tolist())
    for _ in range(30):
        state, dhat = found.estimator.step(state, x.tolist())
        x = A @ x + E @ d
    assert dhat == pytest.approx(d, abs=0.05)


def test_refusals_say_what_is_missing() -> None:
    """No recorded input, one that never changes, or too short a record: a refusal in words that travels as JSON."""
    history = _recorded(5)[0]
    one = history.experiments[0]
    still = Experiment(one.u, one.y, one.x, 0.1, np.column_stack([one.d[:, 0], np.full(SAMPLES, 48.0)]))
    reasons = {
        "not say which inputs": Experiment(one.u, one.y, one.x, 0.1),
        r"d\[1\] never changes": still,
        "record longer": Experiment(one.u[:5], one.y[:5], one.x[:5], 0.1, one.d[:5]),
    }
    for reason, experiment in reasons.items():
        refused = input_estimators.design("one_step", History((experiment,), 0.1), {})
        assert not refused.accepted
        with pytest.raises(MonitorError, match=reason):
            raise MonitorError(refused.verdict)
        assert json.loads(refused.document)["accepted"] is False


def test_unknown_kind_and_option_are_misuse() -> None:
    """A kind or option that does not exist is an error that names what there is."""
    history = _recorded(6)[0]
    with pytest.raises(MonitorError, match="one_step"):
        input_estimators.design("crystal_ball", history, {})
    with pytest.raises(MonitorError, match="one_step: option lag"):
        input_estimators.design("one_step", history, {"lag": 3})
