"""Biases that follow a profile."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from dgu_sim.attacks import build_attack

Outputs = list[tuple[float, ...]]
Phi = Callable[..., NDArray[np.float64]]

ROUNDING = 1e-12  # of y + phi - y with y up to 400


def test_ramp_grows_with_its_rate_and_stays_after_the_rise(outputs: Outputs, phi: Phi) -> None:
    """Check phi = rate * min(t, rise_sec)."""
    attack = build_attack("bias_ramp", {"rate": [1.0, -2.0, 0.5], "rise_sec": 1.5})
    time_sec = np.minimum(0.01 * np.arange(len(outputs)), 1.5)
    expected = time_sec[:, None, None] * np.array([1.0, -2.0, 0.5])
    np.testing.assert_allclose(phi(attack, outputs), np.broadcast_to(expected, (600, 2, 3)), rtol=0, atol=ROUNDING)


def test_ramp_without_an_end_grows_on(outputs: Outputs, phi: Phi) -> None:
    """Without rise_sec the last sample has the largest phi."""
    attack = build_attack("bias_ramp", {"rate": [0.0, 1.0, 0.0]})
    assert phi(attack, outputs)[-1, 0, 1] == pytest.approx(5.99, abs=ROUNDING)


def test_sine_repeats_after_its_period(outputs: Outputs, phi: Phi) -> None:
    """Check phi = amplitude * sin(2 pi t / period)."""
    attack = build_attack("bias_sine", {"amplitude": [0.1, 0.2, 0.3], "period_sec": 0.5})
    found = phi(attack, outputs)
    expected = np.sin(2.0 * np.pi * np.arange(600) / 50.0)[:, None, None] * np.array([0.1, 0.2, 0.3])
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), rtol=0, atol=ROUNDING)


def test_pulses_come_every_period_for_their_width(outputs: Outputs, phi: Phi) -> None:
    """A pulse is the bias for width_sec from the start of every period, 0 otherwise."""
    attack = build_attack("bias_pulse", {"bias": [0.0, 1.0, 0.0], "period_sec": 0.2, "width_sec": 0.05})
    on = np.arange(600) % 20 < 5
    np.testing.assert_allclose(phi(attack, outputs)[:, 1, 1], on.astype(float), rtol=0, atol=ROUNDING)


def test_a_pulse_shorter_than_a_sample_lasts_one(outputs: Outputs, phi: Phi) -> None:
    """No pulse vanishes between two samples."""
    attack = build_attack("bias_pulse", {"bias": [0.0, 1.0, 0.0], "period_sec": 0.1, "width_sec": 0.001})
    assert int((phi(attack, outputs)[:, 0, 1] > 0.5).sum()) == 60


@pytest.mark.parametrize(("distribution", "std"), [("uniform", 1.0 / np.sqrt(3.0)), ("gaussian", 1.0)])
def test_random_bias_has_its_spread_and_is_new_on_every_link(
    outputs: Outputs, phi: Phi, distribution: str, std: float
) -> None:
    """Mean 0, the distribution's deviation, links and blocks independent."""
    attack = build_attack("bias_random", {"spread": [1.0, 2.0, 0.0], "distribution": distribution})
    found = phi(attack, outputs)
    assert np.abs(found.mean(axis=0)[:, :2]).max() < 4.0 * 2.0 * std / np.sqrt(600)  # four standard errors
    np.testing.assert_allclose(found.std(axis=0)[:, :2], [[std, 2 * std]] * 2, rtol=0.15)  # four standard errors
    assert np.abs(found[:, :, 2]).max() < ROUNDING
    assert abs(np.corrcoef(found[:, 0, 0], found[:, 1, 0])[0, 1]) < 0.17
    assert abs(np.corrcoef(found[:256, 0, 0], found[256:512, 0, 0])[0, 1]) < 0.25


def test_random_numbers_depend_on_seed_and_attack_number_only(outputs: Outputs, phi: Phi) -> None:
    """The same seed and number give the same bits; another seed or number gives others."""
    attack = build_attack("bias_random", {"spread": [1.0, 1.0, 1.0]})
    first = phi(attack, outputs, seed=5, number=1)
    assert np.array_equal(first, phi(attack, outputs, seed=5, number=1))
    assert not np.array_equal(first, phi(attack, outputs, seed=6, number=1))
    assert not np.array_equal(first, phi(attack, outputs, seed=5, number=2))
