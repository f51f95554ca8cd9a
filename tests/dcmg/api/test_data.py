"""Designs from arrays: forgiving about what they look like, one line about what cannot be."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd  # type: ignore[import-untyped] # a dependency of the tests alone
import pytest
import xarray as xr

import dcmg


def _plant(samples: int = 200) -> tuple[Any, Any]:
    """States and known input of x+ = A x + B u + E d."""
    rng = np.random.default_rng(3)
    x, u = np.zeros((samples, 2)), rng.uniform(-1.0, 1.0, samples)
    A, B, E = np.array([[0.8, 0.2], [-0.1, 0.9]]), np.array([0.0, 0.5]), np.array([1.0, 0.0])
    for t in range(samples - 1):
        x[t + 1] = A @ x[t] + B * u[t] + E * rng.uniform(-1.0, 1.0)
    return x, u


def test_arrays_of_any_kind_give_one_design() -> None:
    """Numpy, lists, data frames, xarray; a known input of shape (T,) or (T, 1); x left out where y is x."""
    x, u = _plant()
    wanted = dcmg.design(y=x, x=x, u=u[:, None], sampling_period_sec=0.01)
    assert wanted.accepted, wanted.verdict
    for y, known in (
        (x.tolist(), u.tolist()),
        (pd.DataFrame(x, columns=["a", "b"]), pd.Series(u)),
        (xr.DataArray(x, dims=("time", "signal")), xr.DataArray(u)),
    ):
        made = dcmg.design(y=y, u=known, sampling_period_sec=0.01)
        assert made.certificate.to_json() == wanted.certificate.to_json()
    assert dcmg.design(dcmg.history(y=x, u=u, sampling_period_sec=0.01)).verdict == wanted.verdict


def test_a_recording_is_what_steps_give() -> None:
    """`run_observer` is `observer.step` again and again, bit for bit."""
    x, u = _plant()
    made = dcmg.design(y=x, u=u, sampling_period_sec=0.01)
    assert made.observer is not None
    found = dcmg.run_observer(made.observer, x, u)
    state = made.observer.init([u[0]], list(x[0]))
    for step in range(len(x)):
        state, one = made.observer.step(state, [u[step]], list(x[step]))
        assert np.array(one.residual).tobytes() == found.residual[step].tobytes()
    assert found.estimate.shape == x.shape


def test_an_exact_recording_raises_no_alarm_and_a_changed_one_does() -> None:
    """Design, observer and detector together, on data of which the truth is known."""
    x, u = _plant(400)
    made = dcmg.design(y=x[:200], u=u[:200], sampling_period_sec=0.01)
    assert made.observer is not None
    detector = dcmg.detector("fixed", sampling_period_sec=0.01, settle_sec=0.1, calibrate_sec=1.0)
    assert not dcmg.run_detector(detector, dcmg.run_observer(made.observer, x, u).residual).alarm.any()
    x[300:, 1] += 0.1
    alarm = dcmg.run_detector(detector, dcmg.run_observer(made.observer, x, u).residual).alarm
    assert not alarm[:300].any()
    assert alarm[300:302].any()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"y": np.zeros((5, 2, 2))}, "y has shape (5, 2, 2), expected (samples, columns)"),
        ({"y": [["a", "b"]]}, "y is no table of numbers"),
        ({"y": np.zeros((50, 2)), "x": np.zeros((49, 2))}, "record them at the same instants"),
        ({"y": np.zeros((50, 2)), "sampling_period_sec": "fast"}, "sampling_period_sec is 'fast', expected a number"),
        ({"y": np.zeros((50, 2)), "sampling_period_sec": None}, "sampling_period_sec is missing"),
        ({"x": np.zeros((50, 2))}, "y or sampling_period_sec is missing, expected dcmg.design(u=u, y=y, x=x"),
        ({"y": np.zeros((50, 2)), "kind": "full_ordr"}, "did you mean full_order?"),
        ({"y": np.random.default_rng(1).normal(size=(50, 2)), "unknown_input": 1}, "unknown_input"),
    ],
)
def test_what_cannot_be_is_one_line(arguments: dict[str, Any], said: str) -> None:
    """An exception of the package, with the name of the argument and what was expected."""
    with pytest.raises(dcmg.MonitorError) as caught:
        dcmg.design(**{"sampling_period_sec": 0.01, **arguments})
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_observer_is_fed_what_it_was_designed_for() -> None:
    """A column too few is refused, not broadcast."""
    x, u = _plant()
    made = dcmg.design(y=x, u=u, sampling_period_sec=0.01)
    assert made.observer is not None
    with pytest.raises(dcmg.HistoryError, match="y has shape"):
        dcmg.run_observer(made.observer, x[:, :1], u)
    with pytest.raises(dcmg.HistoryError, match="u has shape"):
        dcmg.run_observer(made.observer, x)
    with pytest.raises(dcmg.MonitorError, match="did you mean cusum"):
        dcmg.detector("cusm", sampling_period_sec=0.01)
