"""What every detector must do, whatever its method."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from monitor.detectors import KINDS, Phase, build, matched

if TYPE_CHECKING:
    from collections.abc import Callable

    from monitor.detectors import Detector
    from monitor.observers import LinearObserver

CALIBRATED = {"settle_sec": 0.05, "calibrate_sec": 0.4}
EXAMPLES: dict[str, dict[str, object]] = {
    "fixed": {**CALIBRATED, "margin": 1.0},
    "noise_bound": {"noise": 0.5, "settle_sec": 0.05},
    "chi_squared": {**CALIBRATED, "rate": 0.1},
    "cusum": {**CALIBRATED, "between_sec": 0.5, "margin": 1.0},
    "n_of_m": {"n": 2, "m": 3, "kind": "fixed", "options": {**CALIBRATED, "margin": 0.5}},
    "calibrated": {**CALIBRATED, "rate": 0.1},
}


@pytest.fixture(name="detector", params=EXAMPLES)
def _detector(request: pytest.FixtureRequest, uio: LinearObserver) -> Detector[Any]:
    return matched(build(request.param, EXAMPLES[request.param], 0.01), uio)


def test_examples_cover_every_kind() -> None:
    """A new detector is in this test, or it fails here."""
    assert set(EXAMPLES) == set(KINDS)


def test_promise_is_one_line(detector: Detector[Any]) -> None:
    """Each says what it promises about false alarms."""
    assert len(detector.promise) > 40
    assert "\n" not in detector.promise


def test_arrays_and_floats_agree(judge: Callable[..., Any], detector: Detector[Any]) -> None:
    """Six links in arrays, samples lost here and there: the bits of each link alone in Python floats."""
    generator = np.random.default_rng(0)
    residuals = generator.standard_normal((120, 3, 6))
    residuals[:, 2] = 0.5 * residuals[:, 0]
    lost = generator.uniform(size=(120, 6)) < 0.03
    residuals[np.broadcast_to(lost[:, None], residuals.shape)] = math.nan
    together = judge(detector, residuals)
    assert together.alarm.any()
    for link in range(6):
        state = detector.init(3)
        for k, residual in enumerate(residuals[:, :, link].tolist()):
            state, verdict = detector.step(state, tuple(residual))
            assert verdict.phase == together.phase[k, link]
            assert bool(verdict.alarm) == together.alarm[k, link]
            assert np.array_equal(list(verdict.threshold), together.threshold[k, :, link], equal_nan=True)


def test_nothing_is_said_before_it_is_armed(judge: Callable[..., Any], detector: Detector[Any]) -> None:
    """No alarm while settling, calibrating, or at a sample that never came."""
    residuals = np.random.default_rng(1).standard_normal((120, 3, 4)) * 100.0
    residuals[60:63, :, 1] = math.nan
    judged = judge(detector, residuals)
    assert not judged.alarm[judged.phase != Phase.ARMED].any()
    assert (judged.phase[60:68, 1] == Phase.SETTLING).all()
    assert judged.phase[68, 1] == Phase.ARMED


def test_a_great_residual_alarms_after_silence(judge: Callable[..., Any], detector: Detector[Any]) -> None:
    """Calibrated on zeros, nothing is divided by zero; a residual of 1 is seen at once, or with its successors."""
    residuals = np.zeros((60, 3, 2))
    residuals[55:] = 1e3
    alarm = judge(detector, residuals).alarm
    assert not alarm[:55].any()
    assert alarm[56:].all()
