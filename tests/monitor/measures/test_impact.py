"""Impact on the grid and errors of estimates."""

from __future__ import annotations

import math

import numpy as np
import pytest

from monitor.measures import ErrorSums, block_sums, estimate_errors, grid_impact, impact_of


def test_a_grid_at_its_goals_has_no_distance_from_them() -> None:
    """Equal shares of rated currents and voltages at their references: every measure is zero."""
    nominal, rated = np.array([[48.0, 47.0]] * 5), np.array([2.0, 3.0])
    found = grid_impact(nominal, 1.5 * np.tile(rated, (5, 1)), nominal, rated)
    for values in (found.mean_voltage, found.voltage, found.sharing):
        np.testing.assert_array_equal(values, np.zeros(5))


def test_distances_are_signed_largest_and_spread() -> None:
    """Opposite voltage errors cancel in the mean only."""
    found = grid_impact(
        np.array([[48.3, 46.9]]), np.array([[2.0, 6.0]]), np.array([[48.0, 47.0]]), np.array([2.0, 3.0])
    )
    assert found.mean_voltage[0] == pytest.approx(0.1)
    assert found.voltage[0] == pytest.approx(0.3)
    assert found.sharing[0] == pytest.approx(1.0)


def test_impact_of_a_ramp() -> None:
    """A ramp is as large as the time that it had: until the alarm, until the end."""
    ramp = np.arange(100, dtype=np.float64) * 0.005
    found = impact_of(ramp, (20, 80), 39, 0.01, context_steps=5)
    assert (found.before, found.until_detection, found.largest) == (ramp[19], ramp[39], ramp[84])
    assert found.rate == pytest.approx(0.5)
    missed = impact_of(ramp, (20, 80), None, 0.01, context_steps=5)
    assert missed.until_detection == ramp[79]
    assert math.isnan(impact_of(np.full(10, np.nan), (2, 5), None, 0.01, context_steps=1).largest)


def test_mean_errors_of_a_known_series() -> None:
    """MSE and MAE are those of all samples that were compared, whatever the blocks."""
    errors = np.random.default_rng(0).normal(size=(200, 2))
    sums = ErrorSums(
        count=block_sums(np.ones_like(errors), 7),
        absolute=block_sums(np.abs(errors), 7),
        squared=block_sums(errors * errors, 7),
    )
    found = estimate_errors(sums, seed=1)
    assert found.samples == 200
    assert [one.value for one in found.mae] == pytest.approx(np.abs(errors).mean(axis=0).tolist())
    for one, truth in zip(found.mse, (errors * errors).mean(axis=0), strict=True):
        assert one.value == pytest.approx(truth)
        assert one.interval is not None
        assert one.interval.low < one.value < one.interval.high
