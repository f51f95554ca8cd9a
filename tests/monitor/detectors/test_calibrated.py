"""The calibrated detector keeps the false-alarm rate that it promises, on held-out samples."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.stats import betabinom

from monitor.detectors import Phase, build
from monitor.detectors.calibrated import CalibratedDetector
from monitor.errors import MonitorError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from monitor.observers import LinearObserver

RUNS, HELD_OUT = 400, 200
OPTIONS = {"settle_sec": 0.1, "calibrate_sec": 2.49, "rate": 0.05}  # 49 samples for the weights, n = 200, k = 10
DISTRIBUTIONS: dict[str, Callable[[np.random.Generator, tuple[int, ...]], NDArray[np.float64]]] = {
    "uniform": lambda generator, shape: generator.uniform(-1.0, 1.0, shape),
    "gaussian": lambda generator, shape: generator.standard_normal(shape),
    "heavy tails": lambda generator, shape: generator.standard_t(2.5, shape),
}


def _detector() -> CalibratedDetector:
    detector = build("calibrated", OPTIONS, 0.01)
    assert isinstance(detector, CalibratedDetector)
    return detector


@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
def test_rate_of_independent_residuals_is_the_promised_one(judge: Callable[..., Any], distribution: str) -> None:
    """The alarms in all held-out samples lie within the 95 % interval of k/(n+1), Beta-distributed by calibration."""
    detector = _detector()
    k, n = detector.kept, detector.schedule.calibrate_steps - detector.weigh_steps
    generator = np.random.default_rng(11)
    start = detector.schedule.settle_steps + detector.schedule.calibrate_steps
    noise = DISTRIBUTIONS[distribution](generator, (start + HELD_OUT, 3, RUNS)) * [[0.01], [0.02], [0.003]]
    judged = judge(detector, noise)
    assert (judged.phase[start:] == Phase.ARMED).all()
    assert not judged.alarm[:start].any()
    rate, deviation = k / (n + 1), betabinom(HELD_OUT, k, n + 1 - k).std() / HELD_OUT / np.sqrt(RUNS)
    assert rate <= detector.rate
    assert abs(judged.alarm[start:].mean() - rate) < 1.96 * deviation


@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
def test_rate_of_a_uio_residual_is_the_promised_one(
    judge: Callable[..., Any], filtered: Callable[..., Any], uio: LinearObserver, distribution: str
) -> None:
    """Correlated samples: the rate over runs lies within the 95 % interval of the promise, as the runs spread it."""
    detector = _detector()
    generator = np.random.default_rng(12)
    start = detector.schedule.settle_steps + detector.schedule.calibrate_steps
    noise = DISTRIBUTIONS[distribution](generator, (start + HELD_OUT, 3, RUNS)) * [[0.01], [0.02], [0.003]]
    rates = judge(detector, filtered(uio, noise)).alarm[start:].mean(axis=0)
    k, n = detector.kept, detector.schedule.calibrate_steps - detector.weigh_steps
    assert abs(rates.mean() - k / (n + 1)) < 1.96 * rates.std() / np.sqrt(RUNS)


def test_threshold_is_the_kth_largest_score_of_the_second_stretch(judge: Callable[..., Any]) -> None:
    """Computed once more from the definition, with sorting."""
    detector = _detector()
    settle, learned = detector.schedule.settle_steps, detector.schedule.calibrate_steps
    residuals = np.random.default_rng(3).standard_normal((settle + learned, 3, 1)) * [[1.0], [10.0], [0.1]]
    judged = judge(detector, residuals)
    magnitude = np.abs(residuals[settle:, :, 0])
    weights = magnitude[: detector.weigh_steps].mean(axis=0)
    scores = np.sort((magnitude[detector.weigh_steps :] / weights).max(axis=1))
    # the mean is summed in another order, so the last bits differ
    np.testing.assert_allclose(judged.threshold[-1, :, 0], scores[-detector.kept] * weights, rtol=1e-12)


def test_too_short_a_calibration_is_refused() -> None:
    """A rate that so few samples cannot promise: the message says how long it takes."""
    with pytest.raises(
        MonitorError, match=r"calibrate_sec = 10\.0: expected at least 125 s to promise a rate of 0\.0001"
    ):
        build("calibrated", {"rate": 1e-4}, 0.01)
    build("calibrated", {"rate": 1e-4, "calibrate_sec": 125.0}, 0.01)


def test_promise_says_how_the_threshold_was_set() -> None:
    """Rate, rank and number of scores."""
    assert _detector().promise == (
        "at most 0.05 of the attack-free samples alarm, whatever the distribution: the threshold is number 10 of 200 "
        "attack-free scores, expected rate 0.0498"
    )
