"""Random access to random numbers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dgu_sim.linear import FloatArray
from dgu_sim.signals import BLOCK, RandomSource, first_step


def _draw(generator: np.random.Generator) -> FloatArray:
    return generator.standard_normal((BLOCK, 2))


@given(st.integers(0, 3 * BLOCK), st.integers(1, 2 * BLOCK))
def test_a_value_does_not_depend_on_the_stretch_it_is_read_in(first: int, count: int) -> None:
    """Any stretch equals the same stretch of a longer one."""
    source = RandomSource(seed=5, stream=1, dgu=2)
    whole = source.values(0, 5 * BLOCK + 1, _draw)
    assert np.array_equal(source.values(first, first + count, _draw), whole[first : first + count])


def test_seed_stream_dgu_and_block_are_independent() -> None:
    """Changing any one of the four gives other numbers."""
    base = RandomSource(seed=1, stream=1, dgu=1).generator(0).random(8)
    others = [
        RandomSource(seed=2, stream=1, dgu=1).generator(0),
        RandomSource(seed=1, stream=2, dgu=1).generator(0),
        RandomSource(seed=1, stream=1, dgu=2).generator(0),
        RandomSource(seed=1, stream=1, dgu=1).generator(1),
    ]
    for other in others:
        assert not np.intersect1d(base, other.random(8)).size


def test_numbers_are_the_documented_ones() -> None:
    """Block b is Generator(Philox(SeedSequence((seed, stream, dgu, b)))): others can reproduce a run."""
    expected = np.random.Generator(np.random.Philox(np.random.SeedSequence((7, 3, 2, 4)))).random(5)
    assert np.array_equal(RandomSource(seed=7, stream=3, dgu=2).generator(4).random(5), expected)


@pytest.mark.parametrize(
    ("time_sec", "period_sec", "step"),
    [(0.0, 0.01, 0), (5.0, 0.01, 500), (0.29, 0.01, 29), (0.295, 0.01, 30), (0.07, 0.01, 7), (1e-9, 0.01, 0)],
)
def test_first_step_forgives_decimal_rounding(time_sec: float, period_sec: float, step: int) -> None:
    """A time that is a multiple of T_s on paper gives that multiple, and one in between the next step."""
    assert first_step(time_sec, period_sec) == step
