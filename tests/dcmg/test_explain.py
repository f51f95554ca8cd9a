"""`dcmg explain` on recorded runs of which it is known what happened."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from typer.testing import CliRunner

import dcmg
from bags.golden.runs import golden_path
from dcmg.cli import app
from dcmg.explaining import Explanation, explain
from dgu_sim.grid import Link

if TYPE_CHECKING:
    from pathlib import Path


def _of(bag: Path, link: str, at_sec: float | None = None) -> Explanation:
    return explain(dcmg.open_run(bag), Link.parse(link), at_sec)


def test_the_first_alarm_is_explained_by_the_residual_of_the_record() -> None:
    """Moment, components, ratios and samples before are those of the bag; the attack that acts is named."""
    run = dcmg.read_run(golden_path("biased"))
    found = _of(golden_path("biased"), "1-2")
    place = run.links.index(Link(1, 2))
    assert (found.step, found.alarm) == (int(np.argmax(run.alarm[:, place])), True)
    for component, r, limit in zip(
        found.components, run.residual[found.step, place], run.threshold[found.step, place], strict=True
    ):
        assert component.residual == abs(r)
        assert component.ratio == abs(r) / limit
    assert max(one.ratio for one in found.components) > 1.0
    assert [one["ratio"] is not None and one["ratio"] < 1.0 for one in found.before] == [True] * 5
    assert "alarm, by residual of the link's observer" in found.conclusion
    assert any(line.startswith("bias, bias 0.1 0.1 0.1, from 1 s to 1.4 s") for line in found.attacks)


def test_no_alarm_is_explained_too() -> None:
    """Before the monitor is armed it says so and when; on a quiet link, how close it came."""
    early = _of(golden_path("biased"), "1-2", 0.3)
    assert "still calibrating (armed from 0.9 s on)" in early.conclusion
    quiet = _of(golden_path("attack_free"), "1-2")
    assert not quiet.alarm
    assert quiet.attacks == ()
    assert all(one.ratio < 1.0 for one in quiet.components)


def test_an_attack_that_hides_is_told_with_what_the_observer_cannot_see() -> None:
    """A stealthy attack: no alarm although it acts, and the directions that leave no residual."""
    run = dcmg.open_run(golden_path("stealthy"))
    link = run.events[0].link
    found = explain(run, link, run.events[0].step * run.topics.sampling_period_ns * 1e-9 + 0.1)
    assert not found.alarm
    assert found.conclusion.endswith("although an attack acts on it")
    assert any("stay free to an attacker" in line for line in found.sight)


def test_a_lost_sample_and_a_refused_link(tmp_path: Path) -> None:
    """What did not arrive is not judged; a link without observer names the reason of the refusal."""
    run = dcmg.read_run(golden_path("denial_of_service"))
    step, place = np.argwhere(~run.delivered)[0]
    link = str(run.links[place])
    assert "no sample arrived" in _of(golden_path("denial_of_service"), link, float(step) * 0.01).conclusion
    refused = dcmg.replay(golden_path("biased"), ["monitor.observer={kind: full_order, options: {unknown_inputs: 3}}"])
    assert not any(one.accepted for one in refused.designs.values())
    bag = tmp_path / "refused"
    dcmg.simulate(
        "gallo_six_dgu",
        bag,
        overrides=["duration_sec=0.1", "attacks=[]", "monitor.observer.options={unknown_inputs: 3}"],
    )
    found = _of(bag, "1-2")
    assert found.phase == "refused"
    assert "the link is not monitored: refused: " in found.conclusion


def test_a_combined_monitor_says_which_test_accused(tmp_path: Path) -> None:
    """A frozen spoof is accused by the guard of the stream, whatever the residual shows."""
    spoof = "attacks=[{kind: spoof, link: 1-2, start_sec: 19.6, falsify: {kind: freeze}}]"
    bag = tmp_path / "bag"
    dcmg.simulate("gallo_six_dgu_combined", bag, overrides=["duration_sec=20", spoof])
    found = _of(bag, "1-2")
    assert found.alarm
    assert any(test.startswith("stream guard") for test in found.accused_by)
    assert any(line.startswith("second_publisher from 19.6 s") for line in found.streams)


def test_the_command_prints_text_and_one_json_document() -> None:
    """The same answer for people and for programs; NaN is null."""
    bag = str(golden_path("biased"))
    told = CliRunner().invoke(app, ["explain", bag, "--link", "1-2", "--at", "0.3"])
    assert told.exit_code == 0
    document = json.loads(
        CliRunner().invoke(app, ["explain", bag, "--link", "1-2", "--at", "0.3", "--json"]).output,
        parse_constant=pytest.fail,
    )
    assert document["conclusion"] in told.output
    assert document["components"][0]["threshold"] is None


@pytest.mark.parametrize(
    ("link", "at_sec", "said"),
    [
        ("4-9", None, "expected a link of the run, one of 2-1"),
        ("1-2", 99.0, "from 0 to 1.99 s"),
        ("1-2", -1.0, "from 0"),
    ],
)
def test_what_is_not_in_the_run_is_named(link: str, at_sec: float | None, said: str) -> None:
    """A link or a moment that the run does not have ends in one line."""
    with pytest.raises(dcmg.BagError, match=said):
        _of(golden_path("biased"), link, at_sec)
