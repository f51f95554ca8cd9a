"""One measured truth: a row for each attack and each link, wherever a run is shown."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bags.reporting.assessment import assess
from bags.reporting.documents import run_document
from bags.reporting.judged import Judged, judge
from bags.reporting.options import DEFAULTS
from bags.reporting.page import page
from bags.reporting.timeline import gather
from bags.reporting.topology import drawing
from bags.runs.offline import simulate_to_bag
from bags.runs.reader import read_run
from bags.runs.replay import replay
from bags.runs.run_record import RunRecord
from bags.watch.scenarios import parse_scenario
from bags.wire.arrays import grouped
from dgu_sim.grid import Link
from dgu_sim.relay import Action, Origin, RelayEvent
from dgu_sim.scenario import Scenario

TWO_ON_ONE_LINK = (
    "[{kind: uio_stealthy_trajectory, link: 1-2, start_sec: 0.8, stop_sec: 1.3, rise_sec: 0.3, voltage_v: 0.2},"
    " {kind: bias, link: 1-2, start_sec: 1.9, bias: [0.5, 0.5, 0.1]},"
    " {kind: bias, link: 3-1, start_sec: 2.0, stop_sec: 2.2, bias: [0.5, 0.5, 0.1]},"
    " {kind: freeze, link: 1-3, start_sec: 50.0}]"
)


def _document(record: RunRecord) -> dict[str, Any]:
    timeline = gather([record], record.steps)
    document: dict[str, Any] = json.loads(json.dumps(run_document(timeline, judge(timeline)), allow_nan=False))
    return document


def _judged(record: RunRecord) -> Judged:
    return judge(gather([record], record.steps))


@pytest.fixture(name="run", scope="module")
def _run(scenario: Scenario, tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    """A stealthy attack and a bias on one link, a second bias at the same time, and an attack that never begins."""
    changes = [f"attacks={TWO_ON_ONE_LINK}", "noise={kind: none}"]
    attacked = parse_scenario(scenario.to_yaml(), overrides=changes)
    return read_run(simulate_to_bag(attacked, tmp_path_factory.mktemp("two") / "bag"))


def test_two_attacks_on_one_link_are_two_rows(run: RunRecord) -> None:
    """The stealthy one is missed, the bias is seen at once; a replay and the report say the same."""
    found = _document(run)
    rows = [(one["from_sec"], one["to_sec"], one["began"], one["seen"], one["delay_sec"]) for one in found["attacks"]]
    assert rows == [
        (0.8, 1.3, True, False, None),
        (1.9, None, True, True, 0.0),
        (2.0, pytest.approx(2.2), True, True, 0.0),
        (50.0, None, False, None, None),
    ]
    assert [one["accused_by"] for one in found["attacks"]] == [None, "1-2", "3-1", None]
    assert all(not one["wrongly_accused"] for one in found["attacks"])
    assert _document(replay(run))["attacks"] == found["attacks"]
    link = found["links"][2]
    assert (link["link"], link["attacks"], link["seen"], link["false_alarms"]) == ("1-2", 2, 1, 0)


def test_a_link_with_one_seen_and_one_missed_attack_is_not_drawn_missed(run: RunRecord) -> None:
    """The drawing has a state of its own for it, and the page says what never began."""
    timeline = gather([run], run.steps)
    arrows = {arrow.title.split(":")[0]: arrow.state for arrow in drawing(timeline, judge(timeline)).arrows}
    assert arrows == {"2 → 1": "quiet", "3 → 1": "hit", "1 → 2": "partly", "1 → 3": "quiet"}
    assert "never began: the run ended at 2.4 s" in page(timeline, assess(timeline, DEFAULTS))


def test_simultaneous_attacks_are_judged_as_a_set(run: RunRecord) -> None:
    """Both biases are seen and nothing else is accused: every accusation is right, of the sets one of two is exact."""
    isolation = assess(gather([run], run.steps), DEFAULTS).overall["residual"].isolation
    assert isolation.first_right.value == 1.0
    assert isolation.exact.value == 0.5  # the stealthy attack, alone in its set, is not seen


def test_attack_that_ends_on_its_own_and_one_that_does_not(record: RunRecord) -> None:
    """The attack of 0.1 on 1-2 is seen at once and leaves the other links quiet."""
    found = _judged(record)
    assert [row.stop_sec for row in found.attacks] == [pytest.approx(1.5), None]
    quiet, _, attacked, _ = found.links
    assert attacked.attacked_score > 1.0 > attacked.quiet_score
    assert (quiet.seen, quiet.alarms, quiet.first_alarm_sec) == (0, 0, None)
    assert np.isnan(quiet.attacked_score)
    assert "accepted" in quiet.verdict


def test_interrupted_run(scenario: Scenario, record: RunRecord) -> None:
    """Of a run that ended before its attacks, each says that it never began."""
    for steps in (0, 60):
        cut = replace(record.rows(0, steps), events=(), alarms=())
        found = _document(cut)
        assert [(one["began"], one["seen"]) for one in found["attacks"]] == [(False, None)] * len(scenario.attacks)
        assert [one["from_sec"] for one in found["attacks"]] == [1.0, 2.0]


def test_alarms_on_an_imported_stream_are_not_called_false(record: RunRecord) -> None:
    """Where nobody says what was attacked, an alarm is an alarm."""
    unseen = record.with_arrays({"state.x": np.full_like(record.x, np.nan)})
    foreign = replace(unseen, attachments={}, events=())
    found = _document(foreign)
    assert not found["labelled"]
    assert not found["attacks"]
    assert [one["alarms"] > 0 for one in found["links"]] == [False, True, True, False]
    assert {one["false_alarms"] for one in found["links"]} == {None}


def test_unmonitored_link(record: RunRecord) -> None:
    """A refused design is said, and its missing numbers are null."""
    link = record.links[2]
    refused = replace(record.designs[link], accepted=False, verdict="refused: no data")
    nothing = np.full_like(record.residual, np.nan)
    said: dict[str, Any] = {"residual": nothing, "threshold": nothing}
    said |= {"phase": 0 * record.phase, "alarm": record.alarm & False}
    silent = replace(record.with_arrays(grouped("residual", said)), designs={**record.designs, link: refused})
    found = _document(silent)
    row = found["links"][2]
    assert (row["monitored"], row["verdict"], row["quiet_score"]) == (False, "refused: no data", None)
    assert [one["seen"] for one in found["attacks"]] == [False, False]


def test_bag_without_scenario(record: RunRecord, bag: Path) -> None:
    """A bag that somebody else recorded has no scenario; everything that was measured is still told."""
    found = _document(replace(record, attachments={}, designs={}))
    assert (found["scenario"], found["seed"], found["bag"]) == ("", None, str(bag))
    assert found["links"][2]["verdict"] == "the bag holds no design"
    assert [one["delay_sec"] for one in found["attacks"]] == [0.0, 0.0]


def _event(step: int, attack: int, link: Link, action: Action) -> RelayEvent:
    return RelayEvent(
        step=step, attack=attack, link=link, action=action, kind="bias", parameters="{}", origin=Origin.SERVICE
    )


@settings(max_examples=40, deadline=None)  # gathering a run takes some milliseconds
@given(data=st.data())
def test_rows_say_what_the_alarms_say(record: RunRecord, data: st.DataObject) -> None:
    """Whatever attacks overlap on whatever links: each row follows from the alarms within its own time, and no other.

    Every link alarms exactly while it is attacked, but for the attacks that are to be missed.
    """
    count = data.draw(st.integers(1, 4))
    alarm = np.zeros_like(record.alarm)
    events, expected = [], []
    busy = np.zeros_like(record.alarm)
    for number in range(1, count + 1):
        position = data.draw(st.integers(0, 3))
        start = data.draw(st.integers(60, 230))
        stop = data.draw(st.integers(start + 1, 260))
        ended = min(stop, 240)
        if busy[start:ended, position].any():
            continue
        late = data.draw(st.none() | st.integers(0, ended - start - 1))
        busy[start:ended, position] = True
        if late is not None:
            alarm[start + late : ended, position] = True
        events.append(_event(start, number, record.links[position], Action.START))
        if stop < 240:
            events.append(_event(stop, number, record.links[position], Action.STOP))
        expected.append((start, ended, late, str(record.links[position]), stop < 240))
    told = replace(
        record.with_arrays({"residual.alarm": alarm}),
        attachments={},
        events=tuple(sorted(events, key=lambda one: one.step)),
    )
    found = _judged(told)
    assert [
        (
            row.episode.start_step,
            row.episode.stop_step,
            None if row.episode.alarm_step is None else row.episode.alarm_step - row.episode.start_step,
            str(row.attack.links[0]),
            row.attack.stopped,
        )
        for row in found.attacks
    ] == sorted(expected, key=lambda one: one[0])
    assert all(not row.wrongly_accused for row in found.attacks)
    assert sum(row.seen for row in found.links) == sum(row.episode.detected for row in found.attacks)
    assert not any(row.alarms for row in found.links)


@settings(max_examples=10)
@given(decades=st.lists(st.floats(-6.0, 6.0, width=32), min_size=4, max_size=4))
def test_areas_do_not_depend_on_how_the_scores_of_links_compare(run: RunRecord, decades: list[float]) -> None:
    """Links are not pooled: each area is of its own link whatever its scale, and the least is one of them."""
    timeline = gather([run], run.steps)
    scaled = replace(timeline, score=timeline.score * np.power(10.0, decades, dtype=np.float32))
    areas = []
    for one in (timeline, scaled):
        found = assess(one, DEFAULTS)
        areas.append({link.row.link: link.roc.area.value for link in found.links if link.roc is not None})
        assert found.hardest is not None
        assert found.hardest.roc is not None
        assert found.hardest.roc.area.value == min(areas[-1].values())
    assert areas[1] == pytest.approx(areas[0], abs=1e-12)
