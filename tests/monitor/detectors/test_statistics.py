"""Chi-squared, CUSUM and N-of-M: their promises on the residuals that they are made for."""

from __future__ import annotations

from math import comb, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from monitor.detectors import build, matched
from monitor.detectors.cusum import CusumDetector, exponent
from monitor.detectors.n_of_m import NOfMDetector
from monitor.errors import MonitorError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from monitor.observers import LinearObserver

MIXED = np.array([[1.0, 0.0, 0.0], [0.5, 2.0, 0.0], [0.1, -0.3, 0.05]])


def _gaussian(seed: int, steps: int, runs: int, mix: NDArray[np.float64] = MIXED) -> NDArray[np.float64]:
    drawn = np.random.default_rng(seed).standard_normal((steps, mix.shape[1], runs))
    return np.asarray(np.einsum("ij,kjr->kir", mix, drawn))


@pytest.mark.parametrize("directions", [1, 2, 3])
def test_chi_squared_has_its_rate_for_any_rank(judge: Callable[..., Any], directions: int) -> None:
    """Hotelling's limit: 100 calibration samples, a rate of 0.01, residuals in 1, 2 or 3 directions."""
    detector = build("chi_squared", {"settle_sec": 0.0, "calibrate_sec": 1.0, "rate": 0.01, "floor": 1e-12}, 0.01)
    alarms = judge(detector, _gaussian(4, 300, 1000, MIXED[:, :directions])).alarm
    assert not alarms[:100].any()
    rates = alarms[100:].mean(axis=0)
    assert abs(rates.mean() - 0.01) < 1.96 * rates.std() / sqrt(1000)


def test_chi_squared_sees_what_is_unusual_together_only(judge: Callable[..., Any]) -> None:
    """Two components that always agree raise an alarm when they differ, each within its usual size."""
    residuals = _gaussian(5, 300, 1, np.array([[1.0, 0.01], [1.0, -0.01]]))
    residuals[-1, :, 0] = [0.5, -0.5]
    judged = judge(build("chi_squared", {"settle_sec": 0.0, "rate": 1e-4}, 0.01), residuals)
    assert judged.alarm[-1, 0]
    assert (np.abs(residuals[-1, :, 0]) < judged.threshold[-1, :, 0]).all()


def test_chi_squared_alarms_for_certain_above_the_threshold_shown(judge: Callable[..., Any]) -> None:
    """The threshold is the largest |r_i| of the ellipsoid without alarm."""
    residuals = _gaussian(6, 202, 1)
    for component in range(3):
        calm = judge(build("chi_squared", {"settle_sec": 0.0}, 0.01), residuals)
        above = residuals.copy()
        above[-1, :, 0] = 0.0
        above[-1, component, 0] = 1.0001 * calm.threshold[-1, component, 0]
        assert judge(build("chi_squared", {"settle_sec": 0.0}, 0.01), above).alarm[-1, 0]


def test_chi_squared_alarms_when_a_silent_direction_speaks(judge: Callable[..., Any]) -> None:
    """A component that never moved while calibrating needs no learned variance to be suspicious."""
    residuals = np.zeros((202, 3, 1))
    residuals[:, 0, 0] = _gaussian(7, 202, 1)[:, 0, 0]
    residuals[-1, 2, 0] = 1e-6
    assert judge(build("chi_squared", {"settle_sec": 0.0, "calibrate_sec": 2.0}, 0.01), residuals).alarm[-1, 0]


def test_cusum_keeps_the_mean_time_between_false_alarms(judge: Callable[..., Any]) -> None:
    """At least 1000 samples in the mean over runs (95 % lower limit), for three dependent components."""
    options = {"settle_sec": 0.0, "calibrate_sec": 2.0, "between_sec": 10.0, "margin": 1.0}
    detector = build("cusum", options, 0.01)
    alarms = judge(detector, _gaussian(8, 200 + 4000, 300)).alarm[200:]
    # runs without an alarm count with the steps watched: that can only shorten the mean
    first = np.where(alarms.any(axis=0), alarms.argmax(axis=0) + 1, len(alarms)).astype(np.float64)
    assert first.mean() - 1.96 * first.std() / sqrt(300) > 1000.0


def test_cusum_exponent_solves_its_equation() -> None:
    """E exp(theta (|z| - drift)) = 1 over the normal density, integrated numerically."""
    z = np.linspace(-12.0, 12.0, 200_001)
    density = np.exp(-0.5 * z * z) / sqrt(2.0 * np.pi)
    for drift in (0.9, 1.3, 2.0):
        theta = exponent(drift)
        assert theta > 0.0
        mean = float(np.sum(density * np.exp(theta * (np.abs(z) - drift))) * (z[1] - z[0]))
        assert mean == pytest.approx(1.0, rel=1e-8)


def test_cusum_sees_a_small_lasting_shift_that_no_single_sample_shows(judge: Callable[..., Any]) -> None:
    """A shift of 1.5 deviations raises the alarm within seconds, and the alarm ends after it."""
    residuals = 0.1 * _gaussian(9, 1400, 50, np.eye(3))
    residuals[700:1000] += 0.15
    alarm = judge(build("cusum", {"settle_sec": 0.0, "calibrate_sec": 5.0}, 0.01), residuals).alarm
    assert not alarm[:700].any()
    assert alarm[700:1000].any(axis=0).all()
    assert not alarm[1100:].any()


def test_cusum_alarms_exactly_above_the_threshold_shown(judge: Callable[..., Any]) -> None:
    """Threshold and alarm belong together at every step."""
    residuals = _gaussian(10, 600, 20)
    residuals[400:] *= 2.0
    judged = judge(build("cusum", {"settle_sec": 0.0}, 0.01), residuals)
    above = (np.abs(residuals) > judged.threshold).any(axis=1)
    assert np.array_equal(above[200:], judged.alarm[200:])
    assert judged.alarm.any()


def test_n_of_m_counts_the_inner_alarms(judge: Callable[..., Any]) -> None:
    """Three alarms among the last five samples, this one included."""
    inner = {"settle_sec": 0.0, "calibrate_sec": 0.0, "floor": 1.0}
    detector = build("n_of_m", {"n": 3, "m": 5, "kind": "fixed", "options": inner}, 0.01)
    high = [0, 1, 0, 1, 1, 0, 0, 0, 1, 0, 0, 1, 1, 1]
    judged = judge(detector, 2.0 * np.array(high, dtype=np.float64)[:, None, None])
    assert judged.alarm[:, 0].tolist() == [sum(high[max(0, k - 4) : k + 1]) >= 3 for k in range(len(high))]


def test_n_of_m_has_the_binomial_rate_on_independent_residuals(judge: Callable[..., Any]) -> None:
    """An inner rate of 0.0498 becomes sum C(3, k) a^k (1 - a)^(3 - k), averaged over the calibrations."""
    inner = {"settle_sec": 0.0, "calibrate_sec": 2.5, "rate": 0.05}
    detector = build("n_of_m", {"n": 2, "m": 3, "kind": "calibrated", "options": inner}, 0.01)
    rates = judge(detector, _gaussian(11, 250 + 200, 500)).alarm[252:].mean(axis=0)
    a = np.random.default_rng(0).beta(10, 191, 100_000)
    expected = float((comb(3, 2) * a**2 * (1 - a) + a**3).mean())
    assert abs(rates.mean() - expected) < 1.96 * rates.std() / sqrt(500)


def test_n_of_m_hands_the_observer_to_its_inner_detector(uio: LinearObserver) -> None:
    """A wrapped noise bound is matched too."""
    detector = build("n_of_m", {"n": 1, "m": 1, "kind": "noise_bound", "options": {"noise": 0.1}}, 0.01)
    fitted = matched(detector, uio)
    assert isinstance(fitted, NOfMDetector)
    fitted.init(3)


@pytest.mark.parametrize(
    ("kind", "options", "line"),
    [
        ("n_of_m", {"n": 4, "m": 3}, "n_of_m: option n = 4: expected at most m = 3"),
        ("n_of_m", {"kind": "nope"}, "detector kind is 'nope', expected one of"),
        ("chi_squared", {"calibrate_sec": 0.05}, "chi_squared: option calibrate_sec = 0.05: expected at least 0.2 s"),
        ("chi_squared", {"rate": 2}, "chi_squared: option rate = 2: "),
        ("cusum", {"drift": 0.5}, "cusum: option drift = 0.5: "),
        ("cusum", {"floor": 0}, "cusum: option floor"),
    ],
)
def test_wrong_options_get_one_line(kind: str, options: dict[str, object], line: str) -> None:
    """What was found and what was expected."""
    with pytest.raises(MonitorError) as caught:
        build(kind, options, 0.01)
    assert str(caught.value).startswith(line)
    assert "\n" not in str(caught.value)


def test_cusum_limit_grows_with_the_promise() -> None:
    """Lorden: exp(theta h) = p times the samples between alarms."""
    detector = build("cusum", {"between_sec": 100.0}, 0.01)
    assert isinstance(detector, CusumDetector)
    assert np.exp(detector.theta * detector.limit(3)) == pytest.approx(3 * 10_000)
