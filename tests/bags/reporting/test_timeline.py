"""A run gathered window by window, and its measures."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bags.reporting.assessment import assess
from bags.reporting.attacks import attacks_of
from bags.reporting.curves import stretch_length
from bags.reporting.documents import report_document, run_document
from bags.reporting.fold import Envelope
from bags.reporting.judged import judge
from bags.reporting.options import ReportOptions
from bags.reporting.plain import plain
from bags.reporting.timeline import gather
from bags.runs.reader import open_run
from bags.runs.run_record import RunRecord
from dgu_sim.grid import Link

OPTIONS = ReportOptions(block_sec=0.05, aftermath_sec=0.1)


@settings(max_examples=6, deadline=None)  # every example reads the bag
@given(size=st.integers(1, 300))
def test_windows_do_not_matter(bag: Path, record: RunRecord, size: int) -> None:
    """Read in windows of any size, a run has the measures that it has as a whole."""
    whole = gather([record], record.steps, OPTIONS)
    parts = gather(open_run(bag).windows(size), record.steps, OPTIONS)
    np.testing.assert_array_equal(parts.score, whole.score)
    np.testing.assert_array_equal(parts.curves.impact.high, whole.curves.impact.high)
    for link, sums in whole.clear_errors.items():
        np.testing.assert_array_equal(parts.clear_errors[link].count, sums.count)
        # blocks that a window cuts are added up in another order
        np.testing.assert_allclose(parts.clear_errors[link].squared, sums.squared, rtol=1e-12)
    found, expected = (assess(one, OPTIONS) for one in (parts, whole))
    assert plain(found.overall) == plain(expected.overall)
    assert plain(found.attacks) == plain(expected.attacks)


def test_report_and_table_say_the_same(record: RunRecord) -> None:
    """The rows of the table are those of the report, and its rates count what the rows count."""
    timeline = gather([record], record.steps, OPTIONS)
    found, rows = assess(timeline, OPTIONS), judge(timeline, OPTIONS)
    assert plain([one.row for one in found.attacks]) == plain(rows.attacks)
    assert plain([one.row for one in found.links]) == plain(rows.links)
    assert [one.rates.false_alarms for one in found.links] == [one.row.alarms for one in found.links]
    assert found.overall["residual"].rates.false_alarms == sum(row.alarms for row in rows.links)
    document = report_document(timeline, found)
    for key in ("attacks", "links"):
        for whole, row in zip(document[key], run_document(timeline, rows)[key], strict=True):
            assert row.items() <= whole.items()


def test_estimates_are_compared_with_the_state_that_they_are_of(record: RunRecord) -> None:
    """Without noise in the state the error of an estimate that lags by two steps is that of the state two steps ago."""
    late = [np.roll(record.x[:, record.topics.dgus.index(link.source)], 2, axis=0) for link in record.links]
    lagging = replace(
        record.with_arrays({"residual.estimate": np.stack(late, axis=1)}),
        designs={link: replace(one, certificate='{"lag": 2}') for link, one in record.designs.items()},
    )
    sums = gather([lagging], record.steps, OPTIONS).clear_errors[Link(2, 1)]
    assert sums.count.sum() > 300.0
    assert sums.absolute.sum() == 0.0


def test_a_run_without_truth_is_measured_as_far_as_it_can_be(record: RunRecord) -> None:
    """Imported streams have no states: impact and errors are left out, alarms are still counted."""
    blind = replace(record.with_arrays({"state.x": np.full_like(record.x, np.nan)}), attachments={}, designs={})
    timeline = gather([blind], record.steps, OPTIONS)
    found = assess(timeline, OPTIONS)
    assert (timeline.truth, timeline.impact) == (False, None)
    assert all(one.clear_errors is None for one in found.links)
    assert all(not one.impact for one in found.attacks)
    assert found.overall["residual"].rates.quiet_samples > 0


def test_attack_that_stops_on_one_link_first(record: RunRecord) -> None:
    """An attack lasts from its first sample on any link to its last on any."""
    first, stop = record.events[:2]
    events = (first, replace(first, link=Link(3, 1)), replace(stop, step=150))
    (attack,) = attacks_of(replace(record, events=events), record.steps)
    assert (attack.links, attack.start_step, attack.stop_step) == ((Link(3, 1), Link(1, 2)), 100, 240)


@given(
    values=st.lists(st.floats(-1e6, 1e6) | st.just(float("nan")), min_size=1, max_size=60),
    length=st.integers(1, 9),
    cut=st.integers(0, 60),
)
def test_thinning_keeps_every_spike(values: list[float], length: int, cut: int) -> None:
    """An envelope has the extremes of the curve, wherever a window ends."""
    curve = np.array(values)
    found = Envelope.empty(len(curve), length)
    found.add(curve[:cut], 0)
    found.add(curve[cut:], min(cut, len(curve)))
    line = found.line()
    assert len(line) == len(found.times(0.01))
    known = curve[~np.isnan(curve)]
    if len(known):
        assert (np.nanmin(line), np.nanmax(line)) == (known.min(), known.max())


@given(steps=st.integers(0, 10**6), curves=st.integers(1, 10**5))
def test_curves_have_a_bounded_number_of_points(steps: int, curves: int) -> None:
    """However long the run, a curve is drawn with at most 2000 points."""
    length = stretch_length(steps, curves)
    assert length >= 1
    assert -(-steps // length) * (1 if length == 1 else 2) <= 2000
