"""The matrix exponential."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from scipy.linalg import expm as scipy_expm

from dgu_sim.exponential import expm
from dgu_sim.linear import FloatArray

SQUARE = st.integers(1, 6).flatmap(
    lambda n: npst.arrays(np.float64, (n, n), elements=st.floats(-3.0, 3.0, allow_subnormal=False))
)


@given(SQUARE)
def test_agrees_with_scipy(M: FloatArray) -> None:
    """It is the exponential that scipy computes, to the accuracy that squaring leaves at this norm."""
    expected = scipy_expm(M)
    # ||M|| reaches 18: five squarings, each of which may double the relative error.
    np.testing.assert_allclose(expm(M), expected, rtol=1e-11, atol=1e-12 * np.abs(expected).max())


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
