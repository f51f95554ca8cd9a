"""Detection, false alarms, ROC, isolation and score of known sequences."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm
from sklearn.metrics import roc_auc_score, roc_curve  # type: ignore[import-untyped]

from monitor.measures import (
    Episode,
    alarm_rates,
    batadal,
    changed,
    detect,
    isolation,
    missed_rate,
    onsets,
    quiet_steps,
    roc,
    score,
    spans,
    under_attack,
)


def _flags(count: int, *steps: int) -> np.ndarray:
    flags = np.zeros(count, dtype=bool)
    flags[list(steps)] = True
    return flags


def test_only_an_alarm_while_the_attack_runs_detects_it() -> None:
    """Alarms before the start and behind the end say nothing about it, but for the monitor's own lag."""
    alarm = _flags(30, 4, 20)
    assert not detect(alarm, (10, 20), 0.1).detected
    late = detect(alarm, (10, 20), 0.1, lag=1)
    assert late.delay_sec == pytest.approx(1.0)
    assert detect(_flags(30, 13, 14), (10, 20), 0.1).alarm_step == 13
    assert missed_rate([late, detect(alarm, (10, 20), 0.1)]).value == 0.5


def test_the_aftermath_of_an_attack_is_neither_quiet_nor_attacked() -> None:
    """Quiet samples are armed, not attacked, and far enough behind an attack."""
    armed = ~_flags(20, 0, 1)
    quiet = quiet_steps(armed, [(5, 8)], 2)
    assert np.flatnonzero(~quiet).tolist() == [0, 1, 5, 6, 7, 8, 9]
    assert np.flatnonzero(under_attack(20, [(5, 8), (-3, 1)])).tolist() == [0, 5, 6, 7]


def test_rates_count_samples_and_onsets() -> None:
    """A false alarm of three samples is one alarm; what is seen under attack is counted apart."""
    alarm = _flags(1000, 10, 11, 12, 20, 500, 501)[:, None]
    attacked = under_attack(1000, [(500, 504)])[:, None]
    found = alarm_rates(alarm, ~attacked, attacked, 0.01, block_steps=10, seed=0)
    assert (found.false_alarm_samples, found.false_alarms, found.quiet_samples) == (4, 2, 996)
    assert found.false_alarm_rate.value == 4 / 996
    assert found.seen_rate.value == 0.5
    assert found.mean_time_between_sec.value == pytest.approx(9.96 / 2)


@given(st.lists(st.tuples(st.floats(0, 5), st.floats(0.1, 5)), min_size=1, max_size=4))
def test_score_exceeds_one_exactly_where_a_component_exceeds_its_threshold(pairs: list[tuple[float, float]]) -> None:
    """The score says what a detector by components says."""
    residual, threshold = np.array(pairs).T
    assert (score(-residual, threshold) > 1.0) == bool(np.any(residual > threshold))
    assert math.isnan(score(residual * np.nan, threshold))


def test_area_of_two_shifted_normal_scores() -> None:
    """Two normal distributions d apart have the area Phi(d / sqrt 2), and the interval holds it."""
    draw = np.random.default_rng(1)
    attacked = under_attack(20_000, [(10_000, 20_000)])[:, None]
    scores = draw.normal(size=(20_000, 1)) + 5.0 + 1.5 * attacked
    found = roc(scores, attacked, ~attacked, block_steps=20, seed=0)
    assert found is not None
    assert found.area.interval is not None
    assert found.area.interval.low < norm.cdf(1.5 / math.sqrt(2.0)) < found.area.interval.high
    assert found.area.value == pytest.approx(norm.cdf(1.5 / math.sqrt(2.0)), abs=0.01)  # 4 standard errors
    assert np.all(np.diff(found.limit) < 0.0)


@given(data=st.data())
def test_curve_and_area_are_those_of_the_library(data: st.DataObject) -> None:
    """Ties included, every point lies on scikit-learn's curve and the area is its area."""
    count = data.draw(st.integers(2, 60))
    scores = np.array(data.draw(st.lists(st.integers(0, 8), min_size=count, max_size=count)), dtype=np.float64)
    attacked = np.array(data.draw(st.lists(st.booleans(), min_size=count, max_size=count)))
    found = roc(scores[:, None], attacked[:, None], ~attacked[:, None], block_steps=1, seed=0)
    if found is None:
        assert attacked.all() or not attacked.any()
        return
    assert found.area.value == pytest.approx(roc_auc_score(attacked, scores))
    false, true, _ = roc_curve(attacked, scores, drop_intermediate=False)
    np.testing.assert_allclose(found.false_positive_rate[:-1], false, atol=1e-15)
    np.testing.assert_allclose(found.true_positive_rate[:-1], true, atol=1e-15)
    assert (found.false_positive_rate[-1], found.true_positive_rate[-1]) == (1.0, 1.0)


def test_attacked_samples_without_a_score_show_nothing() -> None:
    """Lost samples under attack pull the curve down; quiet ones without a score do not count."""
    attacked = under_attack(100, [(50, 100)])[:, None]
    scores = np.where(attacked, 2.0, 0.5)
    scores[75:] = scores[:10] = np.nan
    found = roc(scores, attacked, ~attacked, block_steps=1, seed=0)
    assert found is not None
    assert found.area.value == 0.5  # half of the attacked samples win against all, the others against none
    assert roc(scores, ~attacked & attacked, ~attacked, block_steps=1, seed=0) is None


def test_isolation_tells_the_right_accusation_from_the_wrong_one() -> None:
    """Link 0 is attacked: link 1 is accused first, then both."""
    alarm = np.column_stack([_flags(10, 6, 7), _flags(10, 5, 6), _flags(10)])
    attacked = np.column_stack([under_attack(10, [(5, 8)]), _flags(10), _flags(10)])
    found = isolation(alarm, attacked, np.ones((10, 3), dtype=bool), [(5, 8)])
    assert found.samples.tolist() == [[2, 2, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 7]]
    assert found.attacked_samples.tolist() == [3, 0, 0, 7]
    assert (found.first_right.value, found.exact.value) == (0.0, 0.0)


@given(
    intervals=st.lists(st.tuples(st.integers(0, 20), st.integers(1, 20)), min_size=1, max_size=4),
)
def test_attacks_that_are_all_seen_are_isolated_whatever_overlaps(intervals: list[tuple[int, int]]) -> None:
    """One attack a link, each accused while it runs and nothing else: every set is right, however they overlap."""
    attacks = [(start, start + length) for start, length in intervals]
    attacked = np.column_stack([under_attack(50, [one]) for one in attacks])
    found = isolation(attacked, attacked, np.ones(attacked.shape, dtype=bool), attacks)
    assert (found.first_right.value, found.exact.value) == (1.0, 1.0)
    spoiled = np.column_stack([attacked, attacked.any(axis=1)])
    wider = np.column_stack([attacked, np.zeros(50, dtype=bool)])
    assert isolation(spoiled, wider, np.ones(wider.shape, dtype=bool), attacks).exact.value == 0.0


@given(
    flags=st.lists(st.booleans(), min_size=1, max_size=40),
    before=st.booleans(),
    cut=st.integers(0, 40),
)
def test_edges_are_the_same_however_a_run_is_cut(flags: list[bool], before: bool, cut: int) -> None:  # noqa: FBT001 - drawn
    """Onsets and ends of the parts are those of the whole, and pairing them gives the flags back."""
    whole, start = np.array(flags), np.array(before)
    cut = min(cut, len(whole))
    first, second = whole[:cut], whole[cut:]
    joined = [changed(first, start), changed(second, first[-1] if cut else start)]
    np.testing.assert_array_equal(np.concatenate(joined), changed(whole, start))
    np.testing.assert_array_equal(onsets(whole), changed(whole) & whole)
    told = [(int(step), "it", bool(whole[step])) for step in np.flatnonzero(changed(whole))]
    lasted = spans(told, len(whole)).get("it", [])
    np.testing.assert_array_equal(under_attack(len(whole), lasted), whole)


def _episode(delay_sec: float | None) -> Episode:
    step = None if delay_sec is None else 0
    return Episode(start_step=0, stop_step=10, alarm_step=step, start_sec=0.0, duration_sec=10.0, delay_sec=delay_sec)


def test_batadal_score() -> None:
    """S_TTD counts a missed attack as found at its end, S_CM averages the two rates, and the score the two."""
    found = batadal([_episode(1.0), _episode(None)], 0.6, 0.1)
    assert found.s_ttd == pytest.approx(1.0 - (0.1 + 1.0) / 2)
    assert found.s_cm == pytest.approx((0.6 + 0.9) / 2)
    assert found.score == pytest.approx((found.s_ttd + found.s_cm) / 2)
    assert math.isnan(batadal([], 0.0, 0.0).score)
