"""A team of monitors in a run without ROS: what it estimates, whom it accuses, and its repetition from a bag."""

import json
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from bags.mcap.bag import open_bag
from bags.mcap.errors import BagError
from bags.reporting.judged import judge
from bags.reporting.pictures import draw
from bags.reporting.timeline import gather
from bags.runs.offline import simulate_to_bag
from bags.runs.reader import open_run, read_run
from bags.runs.replay import replay, replay_windows
from bags.runs.run_record import RunRecord
from bags.watch.scenarios import load_scenario, parse_scenario
from bags.watch.team_record import TeamArrays, present
from dgu_sim.scenario import Scenario

FIELDS = ("inputs", "phase", "alarm", "estimate", "disagreement", "threshold")
SCENARIO = Path(__file__).parents[3] / "dcmg/scenarios/team_six_dgu.yaml"
JOIN, LEAVE, LIE, HONEST, ATTACK = 550, 650, 1000, 1100, 1200  # steps of the shipped scenario


@pytest.fixture(name="team_scenario", scope="module")
def _team_scenario() -> Scenario:
    return load_scenario(SCENARIO)


@pytest.fixture(name="run", scope="module")
def _run(team_scenario: Scenario, tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    """The shipped scenario, simulated and read back."""
    return read_run(simulate_to_bag(team_scenario, tmp_path_factory.mktemp("team") / "bag"))


def told(record: RunRecord) -> TeamArrays:
    """What the team of a run told."""
    assert record.told is not None
    return record.told


def errors(record: RunRecord) -> NDArray[np.float64]:
    """Largest |told - true| of any state, (steps, members); NaN while a member is away."""
    truth = record.x.reshape(record.steps, 1, -1)
    return np.asarray(np.max(np.abs(told(record).estimate - truth), axis=2))


def test_every_member_estimates_all_states_under_unknown_loads(run: RunRecord) -> None:
    """From tens of volts and amperes the errors of all 18 states fall to rounding, as fast as the design proved."""
    team = run.team
    assert team is not None
    assert all(design.accepted for design in team.designs.values())
    reports = [json.loads(design.certificate) for design in team.designs.values()]
    assert all(report.pop("running")["E"] for report in reports)  # what each member runs
    assert all(report == reports[0] for report in reports)  # each came to the same design
    found = errors(run)
    assert np.nanmin(found[0]) > 10.0
    # 0.907 a step, 1e-3 of rounding and transients: 0.907**400 = 1e-17 of errors below 1e2
    assert np.nanmax(found[400:JOIN]) < 1e-7


def test_a_member_that_joins_or_leaves_is_taken_in_stride(run: RunRecord) -> None:
    """Absent members say so; the joiner starts within a volt of the truth and everybody is back at rounding in 3 s."""
    there, found = present(told(run)), errors(run)
    assert not there[:JOIN, 2].any()
    assert there[JOIN:, 2].all()
    assert there[:LEAVE, 4].all()
    assert not there[LEAVE:, 4].any()
    assert found[JOIN, 2] < 1.0
    assert np.nanmax(found[JOIN + 300 : LIE]) < 1e-7


def test_a_liar_is_accused_by_its_hearers_alone_and_harms_nobody(run: RunRecord) -> None:
    """Members 2 and 3 accuse 4 for its first false estimate and leave it out: no other error moves."""
    team = run.team
    assert team is not None
    during = [one for one in team.alarms if LIE <= one.step <= HONEST + 1]
    assert {(one.monitor, one.source) for one in during} == {(2, 4), (3, 4)}
    assert {one.step for one in during if one.active} == {LIE + 1}
    assert {one.step for one in during if not one.active} == {HONEST + 1}
    others = np.delete(errors(run)[LIE:ATTACK], [3, 4], axis=1)
    assert np.max(others) < 1e-7


def test_an_attack_that_no_link_monitor_sees_is_seen_by_the_team(run: RunRecord) -> None:
    """The link's residual stays at rounding; member 2 and its neighbours disagree at once, and only member 2 errs."""
    assert run.alarms == ()
    link = [str(one) for one in run.links].index("1-2")
    assert np.nanmax(np.abs(run.residual[ATTACK:, link])) < 1e-12
    team = run.team
    assert team is not None
    accused = {(one.monitor, one.source) for one in team.alarms if one.active and one.step > ATTACK}
    assert accused == {(1, 2), (2, 1), (2, 4), (4, 2)}
    assert min(one.step for one in team.alarms if one.step > ATTACK) <= ATTACK + 3
    assert np.max(errors(run)[ATTACK:, 1]) > 1.0
    assert np.max(errors(run)[ATTACK:, [0, 2, 3, 5]]) < 1e-7


def test_report_and_picture_tell_of_the_team(run: RunRecord, tmp_path: Path) -> None:
    """Who was there for how long, who accused whom, and a picture of the errors beside the others."""
    timeline = gather([run], run.steps)
    assert timeline.team is not None
    document = timeline.team.document()
    assert document["accepted"]
    rows = {row["member"]: row for row in document["members"]}
    assert rows[3]["present_sec"] == pytest.approx(14.0 - JOIN * 0.01)
    assert (rows[4]["accused_by"], rows[4]["first_accused_sec"]) == ((2, 3), pytest.approx((LIE + 1) * 0.01))
    assert max(rows[6]["last_error"]) < 1e-7
    drawn = draw(timeline, judge(timeline), tmp_path)
    assert [path.name for path in drawn] == [
        "states.png",
        "residuals.png",
        "team.png",
    ]


def test_estimates_are_read_as_blocks(run: RunRecord) -> None:
    """The public reader knows that the sequences of a team's messages never change their length."""
    bag = open_bag(run.path)
    assert bag.is_fixed("/dgu_2/estimate")
    found = np.concatenate([block.data["estimate"] for block in bag.blocks("/dgu_2/estimate")])
    assert found.tobytes() == np.ascontiguousarray(told(run).estimate[:, 1]).tobytes()


def test_listening_to_a_liar_does_the_harm_that_the_certificate_says(team_scenario: Scenario, tmp_path: Path) -> None:
    """Without isolation the steady errors of the others are those of lie_response, and the accusations spread."""
    team_changes = "{isolate: false, events: [{member: 4, kind: lies, start_sec: 4.0, bias: [1.0, 0.0, 0.0]}]}"
    changes = [f"monitor.team={team_changes}", "duration_sec=8.0", "attacks=[]"]
    shorter = parse_scenario(team_scenario.to_yaml(), overrides=changes)
    record = read_run(simulate_to_bag(shorter, tmp_path / "bag"))
    team = record.team
    assert team is not None
    harm = np.array(json.loads(team.designs[1].certificate)["harm"])[3, 0]
    truth = record.x[-1].reshape(1, -1)
    off = np.abs(told(record).estimate[-1] - truth)[[0, 1, 2, 4, 5]].reshape(5, 6, 3)
    # 0.91**400 of the approach is left; rounding of the design's 108 x 108 solve
    np.testing.assert_allclose(off.max(axis=(0, 1)), harm, rtol=1e-5)
    assert {one.monitor for one in team.alarms} > {2, 3, 5}


def test_replay_repeats_the_team_bit_by_bit(run: RunRecord) -> None:
    """From the recorded history, outputs and announcements the same estimates, verdicts and designs come out."""
    again = replay(run)
    for name in FIELDS:
        assert getattr(told(again), name).tobytes() == getattr(told(run), name).tobytes(), name
    assert again.team is not None
    assert run.team is not None
    assert repr(again.team.alarms) == repr(run.team.alarms)
    assert again.team.designs == run.team.designs


def test_replay_in_windows_is_the_same(run: RunRecord) -> None:
    """How the steps are grouped changes no bit."""
    parts = [told(one).estimate for one in islice(replay_windows(open_run(run.path).windows(37)), 5)]
    assert np.concatenate(parts).tobytes() == told(run).estimate[: 5 * 37].tobytes()


def test_a_bag_without_a_team_cannot_get_one(record: RunRecord) -> None:
    """A replay cannot invent the record of the whole grid."""
    with pytest.raises(BagError, match=r"/dgu_1/estimate, expected the record of a run with monitor\.team"):
        replay(record, ["monitor.team={settle_sec: 0.1, calibrate_sec: 0.5}"])


def test_a_refused_team_is_told_with_its_reason_and_stays_silent(team_scenario: Scenario, tmp_path: Path) -> None:
    """Loads that are not announced to those who cannot see them violate (18); the run goes on without a team."""
    changes = ["monitor.team={announced: [reference]}", "duration_sec=0.1", "attacks=[]"]
    record = read_run(simulate_to_bag(parse_scenario(team_scenario.to_yaml(), overrides=changes), tmp_path / "bag"))
    assert record.team is not None
    assert {one.accepted for one in record.team.designs.values()} == {False}
    assert "node 1: condition (18) of D fails" in record.team.designs[1].verdict
    assert not told(record).phase.any()
    assert np.isnan(told(record).estimate).all()
