"""What can accuse a link, and what a response avoided."""

from dataclasses import replace

import numpy as np
import pytest

from bags.reporting.alarm_sources import SOURCES
from bags.reporting.assessment import assess
from bags.reporting.options import ReportOptions
from bags.reporting.page import page
from bags.reporting.timeline import gather
from bags.reporting.unanswered import unanswered
from bags.runs.run_record import RunRecord
from bags.watch.scenarios import parse_scenario
from bags.wire.arrays import grouped
from bags.wire.forms import MASKS
from bags.wire.records import StreamRecord
from bags.wire.schema import Parts
from dgu_sim.relay import Origin
from dgu_sim.scenario import Scenario

OPTIONS = ReportOptions(block_sec=0.05)


def _rows(record: RunRecord, first: int, end: int) -> RunRecord:
    """A window of a run."""
    streams = tuple(one for one in record.streams if first <= one.step < end)
    return replace(record.rows(first, end), streams=streams)


def _with_verdict(record: RunRecord) -> RunRecord:
    """The run with verdicts: link 1-2 is accused while it is attacked, and left out from then on for a second."""
    verdict = {name: np.zeros((record.steps, 3), dtype=np.uint64) for name in MASKS}
    verdict["accused"][103:150, 1] = verdict["dropped"][103:250, 1] = 1  # monitor 2, its only link
    local = np.zeros((record.steps, 3), dtype=np.bool_)
    topics = replace(record.topics, parts=Parts(local=False, inputs=False))
    return replace(record, topics=topics).with_arrays(grouped("verdict", {**verdict, "local": local}))


def test_fault_of_a_stream_accuses_until_it_is_over(record: RunRecord) -> None:
    """A second publisher accuses the link from first to last step, whatever windows it spans; a loss does not."""
    fault = StreamRecord(step=90, source=1, monitor=2, kind="second_publisher", active=True, detail="")
    over, lost = replace(fault, step=130, active=False), replace(fault, kind="missing", source=2, monitor=1)
    spoofed = replace(record, streams=(fault, lost, over))
    judge = SOURCES["stream"].start(record.links)
    found = [judge(_rows(spoofed, first, first + 60)) for first in (0, 60, 120, 180)]
    alarm = np.concatenate([one for one in found if one is not None])
    assert np.flatnonzero(alarm[:, 2]).tolist() == list(range(90, 130))
    assert not alarm[:, [0, 1, 3]].any()


def test_sources_that_never_alarmed_are_left_out(record: RunRecord) -> None:
    """A run without losses and spoofing has one source; samples that were lost are another."""
    assert list(gather([record], record.steps, OPTIONS).alarms) == ["residual"]
    lossy = record.with_arrays({"received.delivered": record.delivered & (np.arange(record.steps) != 7)[:, None]})
    assert list(gather([lossy], record.steps, OPTIONS).alarms) == ["residual", "missing"]


def test_verdict_judges_where_there_is_one(record: RunRecord) -> None:
    """Links and attacks are measured by the verdict, and the residual stays beside it."""
    timeline = gather([_with_verdict(record)], record.steps, OPTIONS)
    found = assess(timeline, OPTIONS)
    assert (found.main, set(found.overall)) == ("verdict", {"verdict", "residual"})
    assert [one.row.episode.delay_sec for one in found.attacks] == [pytest.approx(0.03), None]
    assert found.overall["residual"].missed.value == 0.0
    assert found.attacks[1].row.delays_sec == {"verdict": None, "residual": 0.0}
    assert [one.left_out_sec for one in found.links] == [0.0, 0.0, pytest.approx(1.37), 0.0]
    assert "left out<br>" in page(timeline, found)


def test_impact_without_a_response_is_simulated_again(scenario: Scenario, record: RunRecord) -> None:
    """Where nobody acted in the recording either, the run without a response is the recorded one bit for bit."""
    text = parse_scenario(scenario.to_yaml(), overrides=["monitor.response={quiet_sec: 1.0}"]).to_yaml()
    responding = replace(record, attachments={**record.attachments, "scenario.yaml": text.encode()})
    timeline = gather([responding], record.steps, OPTIONS)
    found, recorded = unanswered(timeline), timeline.impact
    assert found is not None
    assert recorded is not None
    np.testing.assert_array_equal(found.mean_voltage, recorded.mean_voltage)
    one = assess(timeline, OPTIONS, found).attacks[0]
    assert one.unanswered == one.impact


def test_nothing_is_said_about_a_response_that_cannot_be_repeated(record: RunRecord) -> None:
    """Without a response, with an attack started by hand, or without the scenario there is nothing to compare with."""
    by_hand = tuple(replace(event, origin=Origin.SERVICE) for event in record.events)
    for run in (record, replace(record, events=by_hand), replace(record, attachments={})):
        assert unanswered(gather([run], record.steps, OPTIONS)) is None
