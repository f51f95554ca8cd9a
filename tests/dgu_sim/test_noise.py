"""Measurement noise."""

import numpy as np

from dgu_sim.noise import GaussianNoise, UniformNoise
from dgu_sim.signals import RandomSource

SOURCE = RandomSource(seed=3, stream=1, dgu=1)
COUNT = 20000


def test_uniform_noise_stays_within_its_bounds_and_fills_them() -> None:
    """No sample exceeds the half-width, and the largest of many comes close."""
    noise = np.abs(UniformNoise(kind="uniform", half_width=(0.1, 0.2, 0.0)).values(0, COUNT, SOURCE)).max(axis=0)
    assert (noise <= [0.1, 0.2, 0.0]).all()
    assert (noise[:2] > [0.0999, 0.1998]).all()  # P(all of 20000 below 99.9 %) = 2e-9


def test_gaussian_noise_has_the_stated_deviation_and_no_correlation() -> None:
    """Deviations are within five standard errors of what was asked for; components are uncorrelated."""
    noise = GaussianNoise(kind="gaussian", std=(0.1, 0.2, 0.3)).values(0, COUNT, SOURCE)
    error = np.abs(noise.std(axis=0) / [0.1, 0.2, 0.3] - 1.0)
    assert (error < 5.0 / np.sqrt(2 * COUNT)).all()
    off_diagonal = np.asarray(np.corrcoef(noise.T))[np.triu_indices(3, 1)]
    assert (np.abs(off_diagonal) < 5.0 / np.sqrt(COUNT)).all()


def test_noise_is_a_function_of_the_step() -> None:
    """A step has one noise, whatever stretch is read."""
    noise = GaussianNoise(kind="gaussian", std=(0.1, 0.2, 0.3))
    assert np.array_equal(noise.values(250, 10, SOURCE), noise.values(0, 300, SOURCE)[250:260])
