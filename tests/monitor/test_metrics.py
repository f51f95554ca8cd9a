"""Measures of one monitored link."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor.metrics import add_steps, init_tally, link_metrics, metrics_of


def _flags(*steps: int) -> np.ndarray:
    flags = np.zeros(20, dtype=bool)
    flags[list(steps)] = True
    return flags


RESIDUAL = np.zeros((20, 2))


def test_delay_counts_from_the_attack() -> None:
    """The first alarm at or after the attack's start detects it."""
    found = link_metrics(_flags(12, 13), RESIDUAL, [(10, 20)], 0.01)
    assert (found.attacked, found.alarm_step, found.false_alarms) == (True, 12, 0)
    assert found.detection_delay_sec == pytest.approx(0.02)
    assert found.attack_start_sec == pytest.approx(0.1)


def test_alarm_before_the_attack_is_false() -> None:
    """Alarms while nothing attacks this link are counted by their onsets and do not detect."""
    found = link_metrics(_flags(3, 4, 7), RESIDUAL, [(10, 20)], 0.01)
    assert (found.false_alarms, found.alarm_step, found.detection_delay_sec) == (2, None, None)


def test_alarm_that_outlives_the_attack_is_no_new_one() -> None:
    """Only onsets outside the attack are false."""
    assert link_metrics(_flags(12, 13, 14, 15), RESIDUAL, [(10, 14)], 0.01).false_alarms == 0


def test_link_without_attack() -> None:
    """Every alarm on a link that is never attacked is false, and the first one is reported."""
    found = link_metrics(_flags(5, 6, 9), RESIDUAL, [], 0.01)
    assert (found.attacked, found.alarm_step, found.false_alarms) == (False, 5, 2)
    assert found.detection_delay_sec is None
    assert np.isnan(found.residual_after)


def test_residual_before_and_after() -> None:
    """Largest |r| on both sides of the attack's start; missing samples and settling do not count."""
    residual = np.zeros((20, 2))
    residual[0], residual[5], residual[8], residual[12] = 9.0, (0.1, -0.4), np.nan, (-2.0, 1.0)
    armed = ~_flags(0, 1, 2)
    threshold = np.tile([0.5, 0.6], (20, 1))
    found = link_metrics(_flags(), residual, [(10, 20)], 0.01, threshold=threshold, armed=armed)
    assert (found.residual_before, found.residual_after) == (0.4, 2.0)
    assert found.threshold.tolist() == [0.5, 0.6]


@given(
    alarm=st.lists(st.booleans(), min_size=20, max_size=20),
    cuts=st.sets(st.integers(0, 20)),
    attack=st.tuples(st.integers(0, 20), st.integers(0, 20)),
)
def test_steps_in_pieces(alarm: list[bool], cuts: set[int], attack: tuple[int, int]) -> None:
    """However a run is cut into pieces, its metrics are those of the whole."""
    verdict, residual = np.array(alarm), np.sin(np.arange(40.0)).reshape(20, 2)
    tally = init_tally(2)
    ends = sorted({0, 20, *cuts})
    for start, end in pairwise(ends):
        rows = slice(start, end)
        tally = add_steps(tally, verdict[rows], residual[rows], [attack], threshold=residual[rows])
    whole = link_metrics(verdict, residual, [attack], 0.01, threshold=residual)
    assert repr(metrics_of(tally, [attack], 0.01)) == repr(whole)
