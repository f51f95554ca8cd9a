"""Bounded history and its decimation."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dcmg.page.trace import Trace, extremes


@given(sizes=st.lists(st.integers(1, 40), min_size=1, max_size=12), capacity=st.integers(5, 60))
def test_the_last_steps_are_kept_and_nothing_else(sizes: list[int], capacity: int) -> None:
    """Whatever the size of the blocks: what fits is there bit for bit, what is older or to come is NaN."""
    total = sum(sizes)
    rows = np.random.default_rng(1).normal(size=(total, 3))
    trace, at = Trace(3, capacity), 0
    for size in sizes:
        trace.add(rows[at : at + size])
        at += size
    assert (trace.end, trace.start) == (total, max(0, total - capacity))
    found = trace.span([2, 0], 0, total + 5)
    assert np.array_equal(found[:, trace.start : total], rows[trace.start :, [2, 0]].T)
    assert np.isnan(found[:, : trace.start]).all()
    assert np.isnan(found[:, total:]).all()
    assert np.array_equal(trace.at(total - 1), rows[-1])


@given(size=st.integers(1, 9), bins=st.integers(0, 9), seed=st.integers(0, 9))
def test_no_spike_is_lost(size: int, bins: int, seed: int) -> None:
    """Every column holds the smallest and the largest number of its steps; NaN only where there is none."""
    values = np.random.default_rng(seed).normal(size=(2, size * bins))
    values[:, ::3] = np.nan
    low, high = extremes(values, size)
    assert low.shape == high.shape == (2, bins)
    for at in range(bins):
        part = values[:, at * size : (at + 1) * size]
        for row in range(2):
            there = part[row][~np.isnan(part[row])]
            wanted = (np.nan, np.nan) if not len(there) else (there.min(), there.max())
            assert np.array_equal((low[row, at], high[row, at]), wanted, equal_nan=True)
