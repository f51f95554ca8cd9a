"""How many trials tell an effect from chance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import fisher_exact

from monitor.measures import more_often, trials_needed
from monitor.measures.contrast import LIMIT, TRIALS, _power


@settings(max_examples=60, deadline=None)  # scipy's test takes its time
@given(trials=st.integers(1, 60), data=st.data())
def test_the_test_is_fishers(trials: int, data: st.DataObject) -> None:
    """The p-value is that of the library."""
    hits, chance = data.draw(st.integers(0, trials)), data.draw(st.integers(0, trials))
    expected = fisher_exact(np.array([[hits, trials - hits], [chance, trials - chance]]), alternative="greater").pvalue
    assert more_often(hits, chance, trials) == pytest.approx(expected, rel=1e-9)


def test_three_of_four_cannot_tell_and_twenty_would() -> None:
    """Three detections of four, none by chance, are not significant; with twenty trials they most likely would be."""
    assert more_often(3, 0, 4) > LIMIT
    assert trials_needed(3, 0, 4) == 20
    assert more_often(4, 0, 4) < LIMIT


@settings(max_examples=30, deadline=None)  # a power is a sum over all outcomes
@given(trials=st.integers(1, 20), data=st.data())
def test_the_proposed_number_is_the_fewest_that_has_the_power(trials: int, data: st.DataObject) -> None:
    """What is proposed shows the effect nine times of ten, and what stands before it in the list does not."""
    hits = data.draw(st.integers(1, trials))
    needed = trials_needed(hits, 0, trials)
    if needed is None:
        return
    share, chance = (hits + 0.5) / (trials + 1.0), 0.5 / (trials + 1.0)
    assert _power(needed, share, chance) >= 0.9
    fewer = [one for one in TRIALS if trials < one < needed]
    assert not fewer or _power(fewer[-1], share, chance) < 0.9


def test_no_effect_needs_no_number() -> None:
    """Where chance alarms as often, no number of trials is promised."""
    assert trials_needed(2, 2, 10) is None
    assert trials_needed(0, 3, 10) is None
