"""The filter of least error: the library's solution where that exists, and one where it gives up."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from monitor.riccati import dual_lqr, filter_gain
from monitor.sight import accumulated


def _radius(A: np.ndarray) -> float:
    return float(np.max(np.abs(np.linalg.eigvals(A))))


@pytest.mark.parametrize("seed", range(40))
def test_the_dual_lqr_is_that_of_the_library(seed: int) -> None:
    """Random pairs up to order 12, unstable and defective ones too: the same gain, to its conditioning."""
    generator = np.random.default_rng(seed)
    n = int(generator.integers(1, 13))
    A = generator.standard_normal((n, n))
    A *= generator.uniform(0.3, 1.5) / _radius(A)
    if seed % 4 == 0:
        A = np.diag(np.ones(n - 1), 1) + generator.uniform(0.5, 1.2) * np.eye(n)
    C = generator.standard_normal((int(generator.integers(1, n + 1)), n))
    found = dual_lqr(A, C)
    assert found is not None
    P = solve_discrete_are(A.T, C.T, np.eye(n), np.eye(len(C)))
    expected = np.linalg.solve(np.eye(len(C)) + C @ P @ C.T, C @ P @ A.T).T
    # two solvers of one equation: rounding times the size of its solution
    assert np.linalg.norm(found - expected) <= 1e-13 * (1.0 + np.linalg.norm(P)) * (1.0 + np.linalg.norm(expected))
    assert _radius(A - found @ C) < 1.0


def test_no_gain_makes_the_error_smaller_in_any_direction() -> None:
    """Correlated noises: the covariance of random gains lies above that of the filter, eigenvalue by eigenvalue."""
    generator = np.random.default_rng(1)
    A, C = 0.5 * generator.standard_normal((4, 4)), generator.standard_normal((2, 4))
    W, V = generator.standard_normal((4, 5)), generator.standard_normal((2, 5))
    L = filter_gain(A, C, W, V)
    assert L is not None

    def covariance(gain: np.ndarray) -> np.ndarray:
        pushed = W - gain @ V
        return accumulated(A - gain @ C, pushed @ pushed.T)

    least = covariance(L)
    for scale in (1e-3, 1e-2, 1e-1):
        other = L + scale * generator.standard_normal(L.shape)
        assert _radius(A - other @ C) < 1.0
        assert np.min(np.linalg.eigvalsh(covariance(other) - least)) > -1e-12


def test_what_cannot_be_stabilised_gives_none_and_no_exception() -> None:
    """An unstable mode that no output shows, also when its growth leaves double precision; the edge counts as one."""
    for mode in (1.0, 1.5, 1e80, 1e200):
        assert dual_lqr(np.diag([mode, 0.5]), np.array([[0.0, 1.0]])) is None
    assert dual_lqr(np.diag([0.999, 0.5]), np.array([[0.0, 1.0]])) is not None
    assert dual_lqr(np.array([[1e-300]]), np.array([[1e-300]])) is not None


def test_a_barely_visible_mode_is_stabilised_where_the_library_gives_up() -> None:
    """Modes that show by 1e-7 only: a gain is found, and it is stable."""
    A = np.diag([594.0, 0.3])
    found = dual_lqr(A, np.array([[1e-7, 1.0]]))
    assert found is not None
    assert _radius(A - found @ np.array([[1e-7, 1.0]])) < 1.0
