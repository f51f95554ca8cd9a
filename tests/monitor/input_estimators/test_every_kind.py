"""Every input estimator of the registry on DGU 1: loads and references from what a neighbour sends."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.typing import NDArray

from monitor import input_estimators
from monitor.errors import MonitorError
from monitor.history import Experiment, History

if TYPE_CHECKING:
    from monitor.input_estimators import InputEstimator

A = np.array([[-0.28837, 0.10333, 5.39842], [-0.40767, -0.33421, 1.71161], [-0.00055, -0.00072, 0.95996]])
E = np.array([[-0.24792, 0.04004], [1.28837, 0.01188], [0.00179, 0.0098]])  # DGU 1, theory.md section 3
MEAN = np.array([11.0, 50.0])
KINDS = ("cl_uie", "delayed", "one_step", "op_uie")
SETTLED = 60  # the slowest start, of cl-UIE, has a radius of .6: .6**60 = 1e-13 of errors of order 100
Floats = NDArray[np.float64]


def run(steps: int, seed: int) -> tuple[Floats, Floats]:
    """(steps, 3) states and the (steps, 2) inputs, MEAN + U(-1, 1)^2."""
    generator = np.random.default_rng(seed)
    d = MEAN + generator.uniform(-1.0, 1.0, (steps, 2))
    rows = [generator.uniform(-1.0, 1.0, 3) + np.array([47.0, 10.0, 11.0])]
    for one in d[:-1]:
        rows.append(A @ rows[-1] + E @ one)
    return np.array(rows), d


def history(outputs: int = 3, samples: int = 80) -> History:
    """One experiment with the applied inputs recorded; outputs not sent are NaN."""
    x, d = run(samples, 1)
    y = np.where(np.arange(3) < outputs, x, np.nan)
    return History((Experiment(np.empty((samples, 0)), y, x, 0.01, d),), 0.01)


def reconstruct(estimator: InputEstimator, y: Floats) -> Floats:
    """Dhat at every step, (steps, m_d), lag and all."""
    state, found = estimator.init(tuple(y[0])), []
    for sample in y:
        state, dhat = estimator.step(state, tuple(sample))
        found.append([float(one) for one in dhat])
    return np.array(found)


def test_all_kinds_are_tested() -> None:
    """A new kind must be added here."""
    assert sorted(input_estimators.KINDS) == list(KINDS)


@pytest.mark.parametrize("outputs", [3, 2])
@pytest.mark.parametrize("kind", KINDS)
def test_inputs_come_back_after_the_lag(kind: str, outputs: int) -> None:
    """On exact data from (V, I_t, v) or (V, I_t): load and reference of a new run, whatever they do."""
    options: dict[str, object] = {"observer": "reduced_order", "observer_options": {"allow_blind": True}}
    made = input_estimators.design(kind, history(outputs), options if (kind, outputs) == ("one_step", 2) else {})
    assert made.estimator is not None, made.verdict
    assert made.channels == tuple(range(outputs))
    assert json.loads(made.document)["accepted"]
    x, d = run(150, 2)
    found, lag = reconstruct(made.estimator, x[:, :outputs]), made.estimator.lag
    np.testing.assert_allclose(found[SETTLED:], d[SETTLED - lag : 150 - lag], rtol=0.0, atol=1e-6)


def test_one_output_gives_a_bound_that_holds() -> None:
    """V only: the delayed estimator's error stays below its bound for deviations as in the history; others refuse."""
    made = input_estimators.design("delayed", history(1, samples=400), {"delay": 2})
    assert made.estimator is not None, made.verdict
    bound = np.asarray(made.numbers["input_bound"])
    d = MEAN + 0.7 * np.random.default_rng(3).uniform(-1.0, 1.0, (600, 2))  # |w| <= 1 with room for rounding of MEAN
    rows = [np.array([47.0, 10.0, 11.0])]
    for one in d[:-1]:
        rows.append(A @ rows[-1] + E @ one)
    found, lag = reconstruct(made.estimator, np.array(rows)[:, :1]), made.estimator.lag
    error = np.max(np.abs(found[300:] - d[300 - lag : 600 - lag]), axis=0)
    assert np.all(error <= bound)
    assert np.max(error / bound) > 0.01  # it is a bound on this, not on something else
    for kind in ("cl_uie", "op_uie"):
        assert "condition (8)" in input_estimators.design(kind, history(1), {}).verdict


def test_an_attacked_output_does_not_disturb_the_inputs() -> None:
    """`attacked`: a false V of any shape changes nothing in dhat."""
    made = input_estimators.design("delayed", history(), {"attacked": [0]})
    assert made.estimator is not None, made.verdict
    x, d = run(200, 4)
    y = x + np.sin(np.arange(200.0))[:, None] * np.array([1.0, 0.0, 0.0])
    found = reconstruct(made.estimator, y)
    np.testing.assert_allclose(found[100:], d[99:-1], rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("kind", ["cl_uie", "delayed", "op_uie"])
def test_floats_and_arrays_give_the_same_bits(kind: str) -> None:
    """One link in floats and a batch of runs in arrays are the same computation."""
    for outputs, options in ((3, {}), (1, {"delay": 2})) if kind == "delayed" else ((3, {}),):
        estimator = input_estimators.design(kind, history(outputs), options).estimator
        assert estimator is not None
        y = np.random.default_rng(3).uniform(-1.0, 1.0, (6, outputs, 3))
        batch, alone = estimator.init(y[0]), [estimator.init(y[0, :, one].tolist()) for one in range(3)]
        for sample in y:
            batch, dhat = estimator.step(batch, sample)
            for one in range(3):
                alone[one], single = estimator.step(alone[one], sample[:, one].tolist())
                assert [float(np.asarray(component)[one]) for component in dhat] == list(single)


@pytest.mark.parametrize(
    ("kind", "options", "expected"),
    [
        ("delayed", {"delay": 0, "goal": "exact"}, "no exact decoupling with delay 0"),
        ("delayed", {"attacked": [5]}, "attacked is (5,), expected positions 0 to 2"),
        ("cl_uie", {"past": 30}, "record longer"),
        ("op_uie", {"future": 1}, "condition (8)"),
    ],
)
def test_refusals_say_why(kind: str, options: dict[str, object], expected: str) -> None:
    """One line that names the condition."""
    made = input_estimators.design(kind, history(), options)
    assert not made.accepted
    assert expected in made.verdict


def test_unknown_options_are_misuse() -> None:
    """Each kind checks its options."""
    for kind in ("cl_uie", "delayed", "op_uie"):
        with pytest.raises(MonitorError, match=f"{kind}: option dely"):
            input_estimators.design(kind, history(), {"dely": 1})
