"""The matrix exponential."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from scipy.linalg import expm as scipy_expm

from dgu_sim.exponential import expm
from dgu_sim.linear import FloatArray

SQUARE = st.integers(1, 6).flatmap(
    lambda n: npst.arrays(np.float64, (n, n), elements=st.floats(-3.0, 3.0, allow_subnormal=False))
)


@settings(max_examples=50)
@given(SQUARE)
def test_agrees_with_scipy(M: FloatArray) -> None:
    """It is the exponential that scipy computes, to the accuracy that squaring leaves at this norm."""
    expected = scipy_expm(M)
    # scipy's own error grows with ||M||, which reaches 18 here.
    np.testing.assert_allclose(expm(M), expected, rtol=1e-11, atol=1e-12 * np.abs(expected).max())


def test_stiff_plant_keeps_its_slow_mode() -> None:
    """A diagonal with rates from 1e-6 to 1e3 is exact to rounding in e^M, and e^M - 1 of the slow mode to 1e-9."""
    rates = np.array([-1e-6, -1.0, -1e3])
    exact = np.exp(rates)
    np.testing.assert_allclose(np.diag(expm(np.diag(rates))), exact, rtol=1e-12, atol=1e-16)
    slow = float(expm(np.diag(rates))[0, 0]) - 1.0
    assert abs(slow / np.expm1(-1e-6) - 1.0) < 1e-9  # 1 - 1e-6 itself is rounded to 1e-16


@settings(max_examples=50)
@given(SQUARE)
def test_inverse_is_the_exponential_of_the_negative(M: FloatArray) -> None:
    """e^M e^-M = I."""
    forward, backward = expm(M), expm(-M)
    scale = np.abs(forward).max() * np.abs(backward).max()
    np.testing.assert_allclose(forward @ backward, np.eye(len(M)), atol=1e-12 * scale)


def test_zero_gives_the_identity() -> None:
    """e^0 = I exactly, so an input that is held stays held."""
    assert np.array_equal(expm(np.zeros((4, 4))), np.eye(4))


def test_nilpotent_matrix_is_exact() -> None:
    """For N^2 = 0 the series ends: e^N = I + N."""
    N = np.array([[0.0, 1e5], [0.0, 0.0]])
    np.testing.assert_allclose(expm(N), np.eye(2) + N, rtol=1e-15)
