"""A run that is steered: every command in its bag, and the same bytes again out of the bag."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from bags.reporting.documents import run_document
from bags.reporting.judged import judge
from bags.reporting.timeline import gather
from bags.runs.following import follow_many
from bags.runs.offline import simulate_to_bag
from bags.runs.reader import open_run, read_run
from bags.runs.replay import replay
from bags.runs.reproduce import reproduce, steered
from bags.watch.orders import order
from bags.watch.scenarios import load_scenario, parse_scenario
from dcmg.shipped import scenario_path
from dgu_sim.commands import COMMANDS, Command
from dgu_sim.errors import DguSimError, ScenarioError, SteeringError
from dgu_sim.relay import Action, Origin
from dgu_sim.simulate import simulate
from monitor.detectors import Phase

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from bags.runs.run_record import RunRecord
    from dgu_sim.scenario import Scenario

SCRIPT = """script=[
 {step: 260, command: attack_start, kind: bias, links: [1-2], parameters: {bias: [0.1, 0.1, 0.1]}},
 {step: 270, command: load_step, dgu: 2, current_a: 1.0}, {at_sec: 2.75, command: clock_pause},
 {step: 275, command: clock_rate, rate: 2.0}, {step: 275, command: clock_resume},
 {step: 280, command: detector_threshold, link: 1-2, threshold: 100.0},
 {step: 285, command: load_ramp, dgu: 3, current_a: 2.0, ramp_sec: 0.1},
 {step: 290, command: detector_threshold, link: 1-2, threshold: [100.0, 1e-9, 100.0]},
 {step: 295, command: reference_set, dgu: 1, voltage_v: 47.5},
 {step: 300, command: detector_off, link: 1-2}, {step: 305, command: detector_on, link: 1-2},
 {step: 310, command: attack_change, kind: bias, links: [1-2], parameters: {bias: [0.0, 0.0, 0.5]}},
 {step: 315, command: detector_recalibrate, link: 1-2}, {step: 318, command: detector_recalibrate, dgu: 4},
 {step: 320, command: attack_stop, link: 1-2},
 {step: 330, command: attack_start, kind: freeze, links: [5-6], start_sec: 3.5, duration_sec: 0.2},
 {step: 340, command: attack_start, kind: freeze, links: [5-4], start_sec: 90}]"""
SHORT = ("duration_sec=6.0", "attacks=[]")
RESPONDING = (  # equal loads: secondary control has nothing to do, so a few seconds are enough to learn from
    *("duration_sec=4.0", "attacks=[]", "monitor.local={}", "monitor.plausibility={limits: {range: [0.4, 0.1]}}"),
    "monitor.response={quiet_sec: 1.0}",
    *(f"dgus.{number}.load=[{{kind: constant, current_a: 12.0}}]" for number in range(6)),
)


class _ByHand:
    """Somebody who commands while the run goes on."""

    def __init__(self, commands: Sequence[tuple[int, Command]]) -> None:
        self._commands = commands
        self.refusals: list[str] = []

    def due(self, step: int) -> list[Command]:
        return [command for when, command in self._commands if when == step]

    def refused(self, command: Command, error: DguSimError) -> None:
        self.refusals.append(f"{command.name}: {error}")


@pytest.fixture(name="scenario", scope="module")
def _scenario() -> Scenario:
    return load_scenario(scenario_path("gallo_six_dgu"), (*SHORT, SCRIPT))


@pytest.fixture(name="bag", scope="module")
def _bag(scenario: Scenario, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return simulate_to_bag(scenario, tmp_path_factory.mktemp("steered") / "bag")


@pytest.fixture(name="record", scope="module")
def _record(bag: Path) -> RunRecord:
    return read_run(bag)


def test_every_command_is_in_the_bag(record: RunRecord, scenario: Scenario) -> None:
    """With its step, in order; attacks too, which are told by their events as well."""
    assert [(one.step, one.command) for one in record.commands] == list(scenario.orders.by_step)
    told = [(one.step, str(one.link), one.action, one.attack) for one in record.events]
    start, stop = Action.START, Action.STOP
    assert told == [
        *[(260, "1-2", start, 1), (310, "1-2", stop, 1), (310, "1-2", start, 2), (320, "1-2", stop, 2)],
        *[(350, "5-6", start, 3), (370, "5-6", stop, 3)],
    ]
    assert {one.origin for one in record.events} == {Origin.SERVICE}


def test_a_detector_does_as_it_is_told(record: RunRecord) -> None:
    """The link's own threshold, one by hand, another, none, the one by hand again, and calibration from the start."""
    at = [str(link) for link in record.links].index("1-2")
    alarm, phase, threshold = record.alarm[:, at], record.phase[:, at], record.threshold[:, at]
    assert alarm[262:280].all()
    assert not alarm[280:290].any()
    assert (threshold[280:290] == 100.0).all()
    assert alarm[291:300].all()
    assert (phase[300:305] == Phase.REFUSED).all()
    assert np.isnan(threshold[300:305]).all()
    assert not alarm[300:305].any()
    assert alarm[305:310].all()
    assert (phase[315:365] == Phase.SETTLING).all()
    assert (phase[366:565] == Phase.CALIBRATING).all()
    assert (phase[566:] == Phase.ARMED).all()
    others = np.delete(
        np.arange(len(record.links)), [i for i, link in enumerate(record.links) if link.target in {2, 4}]
    )
    assert (record.phase[260:, others] == Phase.ARMED).all()
    relearning = [i for i, link in enumerate(record.links) if link.target == 4]
    assert (record.phase[318:366, relearning] == Phase.SETTLING).all()


def test_a_replay_obeys_the_commands(record: RunRecord) -> None:
    """Bit for bit; with another detector they are left out."""
    again = replay(record)
    for name in ("phase", "alarm", "estimate", "residual", "threshold"):
        np.testing.assert_array_equal(getattr(again, name), getattr(record, name))
    told = [[(one.step, one.source, one.monitor, one.active) for one in run.alarms] for run in (again, record)]
    assert told[0] == told[1]
    other = replay(record, ["monitor.detector.options.margin=6"])
    assert (other.phase[300:] == Phase.ARMED).all()


def test_a_steered_run_is_made_again(bag: Path, tmp_path: Path, scenario: Scenario) -> None:
    """Every topic, commands and attacks included; its script is the one that was obeyed."""
    found = reproduce(bag, tmp_path / "again")
    assert (found.differing, found.left_out) == ({}, {})
    again = parse_scenario(steered(bag).to_yaml())
    assert list(again.orders.by_step) == list(scenario.orders.by_step)
    assert (again.attacks, again.steps) == (scenario.attacks, scenario.steps)


def test_a_report_tells_what_was_commanded(record: RunRecord) -> None:
    """In the document of the run."""
    timeline = gather([record], record.steps)
    told = run_document(timeline, judge(timeline))["commands"]
    assert told[1] == {"step": 270, "command": "load_step", "dgu": 2, "current_a": 1.0}
    assert len(told) == len(record.commands)


def test_by_hand_and_by_script_are_the_same(scenario: Scenario) -> None:
    """Whoever commands, whatever the blocks: the same bits; what is refused is told and changes nothing."""
    plain = scenario.model_copy(update={"script": ()})
    wrong = order(plain, {"command": "attack_stop", "link": "6-1"})
    person = _ByHand([*scenario.orders.entries, (100, wrong)])
    blocks = list(simulate(plain, block_steps=77, commands=person))
    (script,) = simulate(scenario)
    assert person.refusals == ["attack_stop: link 6-1: no attack is active on it, expected one to stop"]
    for name in ("x", "y", "load_current", "reference", "received", "delivered"):
        joined = np.concatenate([getattr(block, name) for block in blocks])
        np.testing.assert_array_equal(joined, getattr(script, name))
    assert tuple(one for block in blocks for one in block.commands) == script.commands
    assert tuple(one for block in blocks for one in block.events) == script.events


def test_the_response_is_switched(tmp_path: Path) -> None:
    """Off: nobody is left out of control; on again: the accused link is. The bag is made again out of itself."""
    script = """script=[{step: 300, command: attack_start, kind: bias, links: [1-2], parameters: {bias: [0, 5, 0]}},
      {step: 330, command: response_off}, {step: 350, command: response_on, dgu: 2},
      {step: 360, command: detector_off, link: 1-2}, {step: 380, command: detector_recalibrate, dgu: 3}]"""
    scenario = load_scenario(scenario_path("gallo_six_dgu"), (*RESPONDING, script))
    bag = simulate_to_bag(scenario, tmp_path / "bag")
    record = read_run(bag)
    assert record.combined is not None
    dropped = record.combined.verdict.dropped[:, [str(link) for link in record.links].index("1-2")]
    assert dropped[305:330].all()
    assert not dropped[330:350].any()
    assert dropped[350:360].all()
    again = replay(record)
    np.testing.assert_array_equal(again.alarm, record.alarm)
    assert reproduce(bag, tmp_path / "again").differing == {}


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("{step: 300, command: response_off}", "expected a scenario with monitor.response"),
        ("{step: 10, command: attack_start, kind: freeze, links: [1-2]}", "expected later, or anyway: true: until 2.5"),
    ],
)
def test_a_script_that_does_not_fit_the_monitors_is_refused(entry: str, message: str) -> None:
    """One line that names the entry."""
    with pytest.raises(ScenarioError, match=r"script\.0\.command") as refusal:
        load_scenario(scenario_path("gallo_six_dgu"), (*SHORT, f"script=[{entry}]"))
    assert message in str(refusal.value)


def test_an_order_that_does_not_fit_the_run_is_refused(scenario: Scenario) -> None:
    """One line, and only where there is no such DGU, link or response."""
    wrong: list[tuple[dict[str, object], str]] = [
        ({"command": "load_set", "dgu": 9, "current_a": 1}, "load_set: dgu = 9: expected one of the DGUs 1, 2, 3"),
        ({"command": "response_on"}, "response_on: command = response_on: expected a scenario with monitor.response"),
        ({"command": "attack_stop", "link": "2-6"}, "attack_stop: link = 2-6: expected a link"),
    ]
    for data, message in wrong:
        with pytest.raises(SteeringError) as refusal:
            order(scenario, data)
        assert message in str(refusal.value)
    assert order(scenario, {"command": "clock_pause"}) == COMMANDS["clock_pause"]()


def test_many_runs_at_once_refuse_a_script() -> None:
    """Their monitors would not obey it."""
    steered_one = load_scenario(scenario_path("gallo_six_dgu"), (*SHORT, SCRIPT))
    with pytest.raises(ScenarioError, match=r"script: 1[0-9] commands, expected none in many runs at once"):
        next(follow_many(steered_one, [1, 2]))


def test_a_run_without_commands_has_no_topic_of_them(tmp_path: Path) -> None:
    """Its bag is what it was before there were any."""
    calm = load_scenario(scenario_path("gallo_six_dgu"), ("duration_sec=0.1", "attacks=[]"))
    run = open_run(simulate_to_bag(calm, tmp_path / "calm"))
    assert run.commands == ()
    assert b"\nscript:" not in run.attachments["scenario.yaml"]
    assert "/commands/events" not in (tmp_path / "calm" / "metadata.yaml").read_text()
