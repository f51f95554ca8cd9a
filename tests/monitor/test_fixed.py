"""The fixed detector: settling, calibration, alarms, restarts."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from monitor import detectors
from monitor.detectors import Phase, Verdict
from monitor.detectors.fixed import FixedDetector
from monitor.errors import MonitorError

if TYPE_CHECKING:
    from collections.abc import Sequence

DETECTOR = FixedDetector(settle_steps=3, calibrate_steps=4, margin=2.0, floor=(0.01,))


def _run(residuals: Sequence[Sequence[float]], detector: FixedDetector = DETECTOR) -> list[Verdict]:
    state = detector.init(len(residuals[0]))
    verdicts = []
    for residual in residuals:
        state, verdict = detector.step(state, tuple(residual))
        verdicts.append(verdict)
    return verdicts


def test_phases_follow_each_other() -> None:
    """Three samples settle, four calibrate, then the detector is armed."""
    phases = [verdict.phase for verdict in _run([(0.1, 0.0)] * 9)]
    assert phases == [Phase.SETTLING] * 3 + [Phase.CALIBRATING] * 4 + [Phase.ARMED] * 2


def test_threshold_is_margin_times_the_largest_calibration_residual() -> None:
    """Settling residuals do not count; a component that stayed small gets the floor."""
    verdicts = _run([(9.0, 9.0)] * 3 + [(0.1, 0.0), (-0.3, 0.001), (0.2, 0.0), (0.0, 0.0)] + [(0.0, 0.0)])
    assert all(math.isnan(limit) for verdict in verdicts[:6] for limit in verdict.threshold)
    assert verdicts[-1].threshold == (0.6, 0.01)


@pytest.mark.parametrize(
    ("residual", "alarm"), [((0.61, 0.0), True), ((-0.61, 0.0), True), ((0.0, 0.011), True), ((0.6, 0.01), False)]
)
def test_any_component_above_its_threshold_alarms(residual: tuple[float, float], alarm: bool) -> None:  # noqa: FBT001
    """Alarm = OR over components |r_i| > threshold_i, strictly."""
    assert _run([(0.0, 0.0)] * 3 + [(0.3, 0.0)] * 4 + [residual])[-1].alarm is alarm


def test_no_alarm_before_armed() -> None:
    """Residuals of any size raise nothing while settling and calibrating."""
    assert not any(verdict.alarm for verdict in _run([(1e9, 1e9)] * 7))


def test_missing_sample_settles_again_without_recalibrating() -> None:
    """After a lost sample the threshold is kept and the detector is armed again after settling."""
    lost = (math.nan, math.nan)
    verdicts = _run([(0.1, 0.1)] * 8 + [lost] + [(5.0, 5.0)] * 4)
    assert [verdict.phase for verdict in verdicts[8:]] == [Phase.SETTLING] * 4 + [Phase.ARMED]
    assert not any(verdict.alarm for verdict in verdicts[:-1])
    assert verdicts[-1].alarm
    assert verdicts[-1].threshold == (0.2, 0.2)


def test_calibration_resumes_after_a_missing_sample() -> None:
    """A sample lost during calibration costs a settling, not what was learned."""
    lost = (math.nan, math.nan)
    verdicts = _run([(0.0, 0.0)] * 3 + [(0.4, 0.0)] * 2 + [lost] + [(0.1, 0.0)] * 6)
    assert verdicts[-1].phase == Phase.ARMED
    assert verdicts[-1].threshold == (0.8, 0.01)


def test_arrays_and_floats_agree() -> None:
    """Runs and links in arrays go through the same phases, thresholds and alarms as each alone."""
    generator = np.random.default_rng(0)
    residuals = generator.standard_normal((30, 2, 2, 3))  # steps, components, runs, links
    lost = generator.uniform(size=(30, 2, 3)) < 0.1
    residuals[np.broadcast_to(lost[:, None], residuals.shape)] = math.nan
    state = DETECTOR.init(2)
    together = []
    for step in residuals:
        state, verdict = DETECTOR.step(state, step)
        together.append(verdict)
    for run in range(2):
        for link in range(3):
            alone = _run([tuple(step[:, run, link].tolist()) for step in residuals])
            for one, all_ in zip(alone, together, strict=True):
                assert one.phase == np.broadcast_to(all_.phase, (2, 3))[run, link]
                assert one.alarm == np.broadcast_to(all_.alarm, (2, 3))[run, link]
                limits = [float(np.broadcast_to(limit, (2, 3))[run, link]) for limit in all_.threshold]
                assert np.array_equal(limits, list(map(float, one.threshold)), equal_nan=True)


def test_options_in_seconds_become_steps() -> None:
    """Options are times and thresholds; the detector counts samples."""
    built = detectors.build("fixed", {"settle_sec": 0.2, "calibrate_sec": 1.0, "margin": 3, "floor": [1, 2]}, 0.01)
    assert built == FixedDetector(settle_steps=20, calibrate_steps=100, margin=3.0, floor=(1.0, 2.0))


@pytest.mark.parametrize(
    ("kind", "options", "line"),
    [
        ("nope", {}, "detector kind is 'nope', expected one of calibrated, chi_squared, cusum, fixed"),
        ("fixed", {"marign": 3}, "fixed: option marign = 3: "),
        ("fixed", {"margin": -1}, "fixed: option margin = -1: Input should be greater than 0"),
    ],
)
def test_wrong_options_get_one_line(kind: str, options: dict[str, object], line: str) -> None:
    """Unknown kinds, keys and values are named with what was expected."""
    with pytest.raises(MonitorError) as caught:
        detectors.build(kind, options, 0.01)
    assert str(caught.value).startswith(line)
    assert "\n" not in str(caught.value)


def test_floor_must_fit_the_outputs() -> None:
    """A floor for two outputs does not fit three."""
    with pytest.raises(MonitorError, match="floor has 2 components, expected 1 or 3"):
        FixedDetector(settle_steps=0, calibrate_steps=0, margin=1.0, floor=(1.0, 2.0)).init(3)
