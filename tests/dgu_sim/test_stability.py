"""Stability of the sampled closed loop (theory.md sections 1 and 2)."""

from collections.abc import Callable

import numpy as np
import pytest

from dgu_sim.grid import Grid
from dgu_sim.plant import Coupling
from dgu_sim.scenario import Scenario
from dgu_sim.stability import closed_loop, largest_stable_gain, sampled_grid, spectral_radius

RATED = (1.0,) * 6


def _radius(grid: Grid, coupling: Coupling, gain: float) -> float:
    A, E = sampled_grid(grid, coupling, 0.01)
    return spectral_radius(closed_loop(A, E, grid.laplacian(), RATED, 0.01 * gain), conserved=1)


def test_held_and_joint_grids_are_stable(shipped: Callable[..., Scenario]) -> None:
    """Without secondary control the spectral radius is 0.99495 in both couplings."""
    grid = shipped("gallo_six_dgu").grid
    for coupling in (Coupling.HELD, Coupling.JOINT):
        A, _ = sampled_grid(grid, coupling, 0.01)
        assert spectral_radius(A) == pytest.approx(0.99495, abs=5e-6)


def test_gain_of_one_half_is_unstable_on_these_lines(shipped: Callable[..., Scenario]) -> None:
    """k_I = 0.5 has a next eigenvalue of 1.0115 on the joint grid; k_I = 0.2 and 0.1 are stable in both couplings."""
    grid = shipped("gallo_six_dgu").grid
    assert _radius(grid, Coupling.JOINT, 0.5) == pytest.approx(1.0115, abs=6e-5)
    assert _radius(grid, Coupling.HELD, 0.5) > 1.01
    for coupling in (Coupling.HELD, Coupling.JOINT):
        assert _radius(grid, coupling, 0.2) < 1.0
        assert _radius(grid, coupling, 0.1) < 0.996


def test_one_half_is_stable_with_tenfold_resistances(shipped: Callable[..., Scenario]) -> None:
    """With R_ij x 10 the gain 0.5 is fine."""
    grid = shipped("consensus_six_dgu").grid
    for coupling in (Coupling.HELD, Coupling.JOINT):
        assert _radius(grid, coupling, 0.5) < 0.99


def test_one_eigenvalue_is_exactly_one(shipped: Callable[..., Scenario]) -> None:
    """The closed loop has one eigenvalue 1, with 1'alpha as its conserved quantity."""
    grid = shipped("gallo_six_dgu").grid
    A, E = sampled_grid(grid, Coupling.HELD, 0.01)
    M = closed_loop(A, E, grid.laplacian(), RATED, 0.001)
    left = np.concatenate([np.zeros(18), np.ones(6)])
    np.testing.assert_allclose(left @ M, left, atol=1e-15)
    assert np.sum(np.abs(np.linalg.eigvals(M) - 1.0) < 1e-9) == 1


def test_bisection_finds_the_border(shipped: Callable[..., Scenario]) -> None:
    """Just below the largest stable gain the loop is stable, just above it is not."""
    grid = shipped("gallo_six_dgu").grid
    A, E = sampled_grid(grid, Coupling.HELD, 0.01)
    limit = largest_stable_gain(A, E, grid, RATED, 0.005) / 0.01
    assert _radius(grid, Coupling.HELD, 0.999 * limit) < 1.0 < _radius(grid, Coupling.HELD, 1.001 * limit)
