"""Components."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dgu_sim.linear import add, choose, stack, stack_vectors

FINITE = st.floats(-1e6, 1e6)


@given(st.lists(st.tuples(FINITE, FINITE), min_size=1, max_size=4))
def test_add_gives_the_same_bits_for_floats_and_arrays(pairs: list[tuple[float, float]]) -> None:
    """Adding vectors of floats and of arrays agrees bit for bit."""
    x, y = [a for a, _ in pairs], [b for _, b in pairs]
    assert list(add(x, y)) == np.asarray(add(np.array(x), np.array(y))).tolist()


def test_choose_works_on_floats_and_arrays() -> None:
    """A false condition gives the second value, element by element."""
    assert choose(True, 1.0, 2.0) == 1.0  # noqa: FBT003 - the condition is a truth value
    assert choose(False, 1.0, 2.0) == 2.0  # noqa: FBT003 - the condition is a truth value
    chosen = choose(np.array([True, False]), np.array([1.0, np.nan]), 0.0)
    assert np.asarray(chosen).tolist() == [1.0, 0.0]


def test_stacking_puts_dgus_on_the_last_axis() -> None:
    """One float for each DGU becomes one component of shape (1, DGUs)."""
    assert stack([1.0, 2.0]).shape == (1, 2)
    first, second = stack_vectors([(1.0, 2.0), (3.0, 4.0), (5.0, 6.0)])
    assert first.tolist() == [[1.0, 3.0, 5.0]]
    assert second.tolist() == [[2.0, 4.0, 6.0]]
