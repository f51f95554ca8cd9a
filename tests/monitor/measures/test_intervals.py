"""Confidence intervals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, poisson

from monitor.measures import block_bootstrap, block_sums, clopper_pearson, mean_time_between, median


@given(successes=st.integers(0, 30), more=st.integers(0, 200))
def test_clopper_pearson_leaves_half_of_the_rest_on_each_side(successes: int, more: int) -> None:
    """At each end of the interval the result found, or a more extreme one, has probability 0.025."""
    trials = successes + more
    found = clopper_pearson(successes, trials)
    if not trials:
        assert math.isnan(found.value)
        return
    assert found.interval is not None
    assert found.interval.low <= found.value <= found.interval.high
    if successes:
        assert binom.sf(successes - 1, trials, found.interval.low) == pytest.approx(0.025, rel=1e-6)
    if more:
        assert binom.cdf(successes, trials, found.interval.high) == pytest.approx(0.025, rel=1e-6)


@given(events=st.integers(1, 50), time_sec=st.floats(0.1, 1e5))
def test_time_between_events_by_the_poisson_distribution(events: int, time_sec: float) -> None:
    """At each end of the interval the count found, or a more extreme one, has probability 0.025."""
    found = mean_time_between(events, time_sec)
    assert found.interval is not None
    assert poisson.sf(events - 1, time_sec / found.interval.high) == pytest.approx(0.025, rel=1e-6)
    assert poisson.cdf(events, time_sec / found.interval.low) == pytest.approx(0.025, rel=1e-6)


def test_no_event_at_all_still_bounds_the_time_between() -> None:
    """Without any event in T the mean time is at least T / ln 20, with confidence 0.95; without any time nothing is."""
    found = mean_time_between(0, 100.0)
    assert found.interval is not None
    assert (found.value, found.interval.high) == (math.inf, math.inf)
    assert found.interval.low == pytest.approx(100.0 / math.log(20.0))
    assert math.isnan(mean_time_between(0, 0.0).value)


@given(values=st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=40), length=st.integers(1, 50))
def test_blocks_lose_nothing(values: list[float], length: int) -> None:
    """The sums of all blocks are the sum of all values, however long a block is."""
    sums = block_sums(np.array(values), length)
    assert len(sums) == -(-len(values) // length)
    assert sums.sum() == pytest.approx(sum(values), abs=1e-9)


def test_blocks_widen_the_interval_of_a_correlated_series() -> None:
    """An interval that takes ten equal neighbours for ten samples is too narrow; by blocks it is sqrt(10) as wide."""
    draw = np.random.default_rng(3)
    hits = np.repeat(draw.random(400) < 0.2, 10).astype(float)
    among = np.ones_like(hits)
    width = {}
    for length in (1, 10):
        found = block_bootstrap(block_sums(hits, length), block_sums(among, length), seed=0).interval
        assert found is not None
        width[length] = found.high - found.low
    assert width[10] / width[1] == pytest.approx(math.sqrt(10.0), rel=0.15)  # two bootstraps of 1000 draws


def test_the_bootstrap_covers_what_it_promises() -> None:
    """About 95 of 100 intervals hold the true mean of a correlated series."""
    held = 0
    for seed in range(200):
        series = np.repeat(np.random.default_rng((7, seed)).exponential(size=100), 5)
        found = block_bootstrap(block_sums(series, 5), np.full(100, 5.0), seed=seed, resamples=300).interval
        assert found is not None
        held += found.low <= 1.0 <= found.high
    assert binom.ppf(0.001, 200, 0.92) <= held  # 0.92: percentile intervals of skewed data fall a little short


def test_the_seed_decides() -> None:
    """The same seed gives the same interval, another one another."""
    blocks = np.random.default_rng(0).random(50)
    assert block_bootstrap(blocks, np.ones(50), seed=4) == block_bootstrap(blocks, np.ones(50), seed=4)
    assert block_bootstrap(blocks, np.ones(50), seed=4) != block_bootstrap(blocks, np.ones(50), seed=5)


def test_few_blocks_give_no_interval() -> None:
    """Where there is too little to draw from, the value stands alone."""
    found = block_bootstrap(np.arange(4.0), np.ones(4), seed=0)
    assert (found.value, found.interval) == (1.5, None)
    assert math.isnan(block_bootstrap(np.zeros(0), np.zeros(0), seed=0).value)


@given(count=st.integers(6, 60))
def test_the_median_lies_between_two_order_statistics(count: int) -> None:
    """The interval leaves out at most 5 %, and the next narrower one would leave out more."""
    found = median(np.arange(count, dtype=np.float64)[::-1]).interval
    assert found is not None
    kept = int(found.low) + 1  # the k-th smallest of 0, 1, ... is k - 1
    assert found.high == count - kept
    assert 2.0 * binom.cdf(kept - 1, count, 0.5) <= 0.05 < 2.0 * binom.cdf(kept, count, 0.5)


def test_few_values_have_a_median_and_no_interval() -> None:
    """Five values cannot have an interval of 95 %, and no value has no median."""
    assert median(np.arange(5.0)).interval is None
    assert math.isnan(median(np.empty(0)).value)
