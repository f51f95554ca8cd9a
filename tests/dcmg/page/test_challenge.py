"""Challenges: each can be won and lost, hides what it says, and keeps scores."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from bags.watch.designs import design_scenario
from dcmg.errors import CommandError
from dcmg.page.challenge import Challenge, load_challenge
from dcmg.page.challenge import shipped as shipped_challenges
from dcmg.page.contest import Contest
from dcmg.page.messages import Attack, Frame, View
from dcmg.page.pace import Pace
from dcmg.page.scores import best, keep
from dcmg.page.simulated import Simulated
from dcmg.page.source import RefusalError
from dcmg.page.viewer import Role, Viewer

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from dgu_sim.scenario import Scenario

STEALTHY = {"current_a": "-1", "rise_sec": "1", "knowledge": "model"}
WINNING = {
    "warm_up": ("bias", {"bias": "0 -3 0"}),
    "unheard": ("uio_stealthy_trajectory", STEALTHY),
    "duel": ("bias", {"bias": "0 -3 0"}),
}


@pytest.fixture(name="play")
def _play(shipped: Callable[..., Scenario], tmp_path: Path) -> Callable[[str], Contest]:
    """Begin a shipped challenge."""

    def play(name: str) -> Contest:
        rules = load_challenge(name)
        scenario = shipped(rules.scenario, *rules.changes)
        designs = design_scenario(scenario)
        return Contest(rules, name, "ada", lambda: Simulated(scenario, designs, None), tmp_path / "deep" / "scores")

    return play


def _order(kind: str, parameters: dict[str, str], *links: str, action: str = "start") -> Attack:
    words = {"id": 1, "action": action, "links": links or ("1-2",), "attack": kind, "parameters": parameters}
    return Attack.model_validate_json(json.dumps(words))


def _frame(contest: Contest, role: Role) -> Frame:
    viewer = Viewer(Pace(contest, running=False), role)
    viewer.look(View(panels=["voltage", "1-2", "heat"], span_sec=5, pixels=500))
    frame = viewer.frame()
    assert frame is not None
    return frame


@pytest.mark.parametrize("name", sorted(shipped_challenges()))
def test_every_challenge_can_be_won_and_its_score_is_kept(
    play: Callable[[str], Contest], name: str, tmp_path: Path
) -> None:
    """There is an attack that reaches the goal in time; doing nothing keeps the clock waiting."""
    contest = play(name)
    contest.advance(300)
    assert contest.game().verdict == "ready"
    kind, parameters = WINNING[name]
    contest.attack(_order(kind, parameters))
    contest.advance(round(contest.challenge.within_sec * 100))
    game = contest.game()
    assert (game.verdict, game.share) == ("won", 1.0), game
    assert game.score > 1000
    assert best(tmp_path / "deep" / "scores", name) == [(game.score, "ada")]
    assert game.best == [f"{game.score} ada"]
    with pytest.raises(RefusalError, match="over"):
        contest.attack(_order(kind, parameters))
    contest.again()
    assert contest.game().verdict == "ready"


def test_an_alarm_loses_where_silence_is_asked_for(play: Callable[[str], Contest]) -> None:
    """In `unheard` a loud attack ends the game with nothing; what does too little runs out of time."""
    contest = play("unheard")
    contest.attack(_order("bias", {"bias": "0.1 0.1 0.1"}))
    contest.advance(20)
    assert (contest.game().verdict, contest.game().score) == ("lost", 0)
    assert "1-2" in contest.game().why
    contest.again()
    contest.attack(_order("uio_stealthy_trajectory", {**STEALTHY, "current_a": "-0.1"}))
    contest.advance(6100)
    game = contest.game()
    assert (game.verdict, game.why, game.left_sec) == ("lost", "the time is over", 0.0)
    assert 0 < game.score < 600


def test_nobody_sees_what_is_hidden_before_the_end(play: Callable[[str], Contest]) -> None:
    """The attacker sees no monitor, the defender no attack; when it is over both see everything."""
    contest = play("duel")
    contest.attack(_order("bias", {"bias": "0 -3 0"}))
    contest.advance(30)
    attacker, defender = _frame(contest, "attacker"), _frame(contest, "defender")
    assert {one.state for one in attacker.links} == {"hidden"}
    assert not attacker.details
    assert {one.panel for one in attacker.series} == {"voltage"}
    assert [one.what for one in attacker.log] == ["attack"]
    assert len(attacker.attacks) == 1
    assert [one.state for one in defender.links].count("alarm") == 1
    assert not any(one.attacked for one in defender.links)
    assert not defender.attacks
    assert [one.what for one in defender.log] == ["alarm"]
    contest.advance(9000)
    for role in ("attacker", "defender"):
        frame = _frame(contest, role)
        assert {"attack", "alarm", "note"} <= {one.what for one in frame.log}
        assert frame.details


def test_a_defender_stops_the_harm_by_leaving_the_link_out(play: Callable[[str], Contest]) -> None:
    """What was won without a defender is not with one; honest links left out in the end cost points."""
    contest = play("duel")
    contest.attack(_order("bias", {"bias": "0 -3 0"}))
    contest.advance(30)
    contest.cut("1-2", on=True)
    contest.cut("4-5", on=True)
    assert contest.game().cut == ["1-2", "4-5"]
    contest.advance(9100)
    game = contest.game()
    assert game.verdict == "lost"
    assert 50 <= game.score < 500
    with pytest.raises(RefusalError, match="link 1-5"):
        contest.cut("1-5", on=True)


def test_the_rules_are_held(play: Callable[[str], Contest]) -> None:
    """Other kinds, more links than allowed, what if and a defender where there is none are refused in a line."""
    contest = play("duel")
    with pytest.raises(RefusalError, match=r"bias = -3.5"):
        contest.attack(_order("bias", {"bias": "0 -3.5 0"}))
    with pytest.raises(RefusalError, match="covert"):
        contest.attack(_order("covert", {"load_a": "2"}))
    with pytest.raises(RefusalError, match="at most 1 link"):
        contest.attack(_order("bias", {"bias": "0 1 0"}, "1-2", "2-4"))
    contest.attack(_order("bias", {"bias": "0 1 0"}))
    contest.advance(5)
    with pytest.raises(RefusalError, match="at most 1 link"):
        contest.attack(_order("bias", {"bias": "0 1 0"}, "2-4"))
    contest.attack(_order("bias", {"bias": "0 2 0"}, action="change"))
    with pytest.raises(RefusalError, match="what if"):
        contest.fork()
    with pytest.raises(RefusalError, match="no defender"):
        play("warm_up").cut("1-2", on=True)


def test_a_challenge_of_ones_own_is_checked(tmp_path: Path) -> None:
    """A file works as a name does; what is wrong in it is one line; a scores file with rubbish is read all the same."""
    good = load_challenge("warm_up").model_dump(mode="json")
    path = tmp_path / "mine.yaml"
    path.write_text(json.dumps({**good, "title": "Mine"}))
    assert load_challenge(str(path)) == Challenge.model_validate({**good, "title": "Mine"})
    for wrong in ({"within_sec": -1}, {"more": 1}, {"silent": "perhaps"}):
        path.write_text(json.dumps({**good, **wrong}))
        with pytest.raises(CommandError, match=next(iter(wrong))) as refused:
            load_challenge(str(path))
        assert "\n" not in str(refused.value)
    with pytest.raises(CommandError, match="warm_up"):
        load_challenge("cold_down")
    scores = tmp_path / "scores"
    scores.write_text('nonsense\n{"score": 1}\n')
    keep(scores, "mine", "bob", 7)
    assert best(scores, "mine") == [(7, "bob")]
