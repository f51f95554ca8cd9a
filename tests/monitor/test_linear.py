"""Component algebra: floats and arrays agree bit for bit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from monitor.linear import is_finite, is_missing, larger, matvec, rows_of, select

NUMBERS = st.floats(-1e6, 1e6)


@given(
    st.integers(1, 8).flatmap(
        lambda width: st.tuples(
            arrays(float, (3, width), elements=NUMBERS), arrays(float, (width, 4), elements=NUMBERS)
        )
    )
)
def test_products_have_the_same_bits_in_floats_and_arrays(pair: tuple[np.ndarray, np.ndarray]) -> None:
    """One link in floats (short sums are written out) and four links in arrays give the same bits."""
    matrix, vectors = pair
    stacked = np.asarray(matvec(np.repeat(matrix[:, :, None], 4, axis=2), vectors))
    for link in range(4):
        alone = matvec(rows_of(matrix), tuple(vectors[:, link].tolist()))
        assert [float(row[link]) for row in stacked] == list(alone)


def test_product_is_the_matrix_product() -> None:
    """The fixed order of summation changes rounding only."""
    generator = np.random.default_rng(0)
    for width in (2, 6, 7):
        matrix, vector = generator.standard_normal((4, width)), generator.standard_normal(width)
        assert np.allclose(
            np.asarray(matvec(rows_of(matrix), tuple(vector.tolist()))), matrix @ vector, rtol=1e-14, atol=1e-14
        )


def test_runs_and_links() -> None:
    """A matrix with axes (rows, columns, 1, links) multiplies vectors of components over (runs, links)."""
    generator = np.random.default_rng(0)
    matrix, vector = generator.standard_normal((2, 3, 1, 5)), generator.standard_normal((3, 7, 5))
    product = np.asarray(matvec(matrix, vector))
    assert np.allclose(product, np.einsum("rcl,cjl->rjl", matrix[:, :, 0], vector))


def test_select_and_larger() -> None:
    """Choices work on floats and arrays, and a NaN never becomes the larger one."""
    assert select(True, 1.0, 2.0) == 1.0  # noqa: FBT003 - the flag is data here
    assert np.array_equal(select(np.array([True, False]), np.array([1.0, 1.0]), 2.0), [1.0, 2.0])
    assert larger(1.0, math.nan) == 1.0
    assert np.array_equal(larger(np.array([1.0, 3.0]), np.array([2.0, math.nan])), [2.0, 3.0])


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e308, 0.0])
def test_numbers_that_can_be_computed_with(value: float) -> None:
    """NaN and infinities are told from numbers as math does it."""
    assert is_finite(value) is math.isfinite(value)
    assert is_missing(value) is math.isnan(value)
