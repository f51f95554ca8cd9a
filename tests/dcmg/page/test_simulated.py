"""A simulation as what is shown: the numbers of `dcmg simulate`, and attacks by hand between its steps."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

from bags.runs.following import follow
from bags.runs.live import LiveRun
from bags.watch.designs import RunDesigns, design_scenario
from bags.watch.histories import recorded_states
from dcmg.page.attack_forms import kinds
from dcmg.page.messages import Attack
from dcmg.page.simulated import Simulated
from dcmg.page.source import RefusalError
from dgu_sim.grid import Link

if TYPE_CHECKING:
    from collections.abc import Callable

    from dgu_sim.scenario import Scenario

BIAS = {"bias": "0.1, 0.1 0.1"}


@pytest.fixture(name="made", scope="module")
def _made(shipped: Callable[..., Scenario]) -> tuple[Scenario, RunDesigns]:
    scenario = shipped("gallo_six_dgu", "attacks=[]", "duration_sec=4.0")
    return scenario, design_scenario(scenario)


def _order(action: str, *links: str, **more: object) -> Attack:
    words = {"id": 1, "action": action, "links": links, "attack": "bias", "parameters": BIAS, **more}
    return Attack.model_validate_json(json.dumps(words))


def test_it_shows_the_numbers_of_the_offline_run(shipped: Callable[..., Scenario]) -> None:
    """However the steps are grouped, with an attack of the scenario: the same bits, alarms and attacked steps."""
    scenario = shipped("gallo_six_dgu", "duration_sec=6.0")
    designs = design_scenario(scenario)
    source = Simulated(scenario, designs, scenario.steps)
    sizes = [1, 3, 50, 1, 199]
    while source.advance(sizes[source.head % len(sizes)]):
        pass
    (whole,) = follow(scenario, designs, recorded_states(scenario), 10_000)
    board, channels = source.board, source.board.channels
    assert source.head == scenario.steps
    assert np.array_equal(board.trace.span(channels.dgu("voltage"), 0, scenario.steps).T, whole.block.y[:, 0, :, 0])
    at = scenario.links.index(Link(1, 2))
    residual = board.trace.span(channels.vector("residual", at), 0, scenario.steps).T
    assert np.array_equal(residual, whole.links.residual[:, at], equal_nan=True)
    alarm = board.trace.span(channels.link("alarm"), 0, scenario.steps).T
    assert np.array_equal(alarm, whole.links.alarm)
    attacked = board.trace.span(channels.link("attacked"), 0, scenario.steps).T
    assert not attacked[:500].any()
    assert attacked[500:, at].all()
    assert attacked.sum() == 100
    assert [one.what for one in board.log][:2] == ["attack", "alarm"]


def test_an_attack_by_hand_acts_from_the_next_step_on_its_link_alone(made: tuple[Scenario, RunDesigns]) -> None:
    """It is checked without acting, starts, changes without a clean sample between, and stops."""
    source = Simulated(*made, None)
    source.advance(300)
    assert source.attack(_order("check", "1-2")) == "bias on 1-2: can start"
    source.advance(1)
    assert not source.board.attacks(source.head)
    source.attack(_order("start", "1-2"))
    source.advance(20)
    source.attack(_order("change", "1-2", parameters={"bias": "[0, 0.3, 0]"}))
    source.advance(20)
    (active,) = source.board.attacks(source.head)
    assert (active.links, json.loads(active.parameters)) == (["1-2"], {"bias": [0.0, 0.3, 0.0]})
    source.attack(_order("stop", "1-2"))
    source.advance(10)
    attacked = source.board.trace.span(source.board.channels.link("attacked"), 0, 351)
    at = made[0].links.index(Link(1, 2))
    assert np.flatnonzero(attacked[at]).tolist() == list(range(301, 341))
    assert not np.delete(attacked, at, axis=0).any()
    assert not source.board.attacks(source.head)
    accused = {one.link for one in source.board.log if one.what == "alarm"}
    assert accused == {"1-2"}


@pytest.mark.parametrize(
    ("order", "said"),
    [
        (_order("start", "1-5"), "link 1-5"),
        (_order("start", "1"), "link 1"),
        (_order("start", "1-2", attack="biass"), "bias"),
        (_order("start", "1-2", parameters={"bias": "1 2"}), "bias"),
        (_order("start", "1-2", parameters={"bias": "{"}), "bias"),
        (_order("check", "1-2", parameters={"bias": "1 2 three"}), "bias"),
        (_order("stop", "1-2"), "no attack"),
        (_order("change", "1-2"), "no attack"),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(made: tuple[Scenario, RunDesigns], order: Attack, said: str) -> None:
    """The line names what is wrong, and nothing has changed."""
    source = Simulated(*made, None)
    source.advance(300)
    before = source.run.state
    with pytest.raises(RefusalError, match=said) as refused:
        source.attack(order)
    assert "\n" not in str(refused.value)
    assert source.run.state is before


def test_every_kind_starts_as_its_form_suggests(made: tuple[Scenario, RunDesigns]) -> None:
    """The example that stands in the form of each kind is one that the relay takes."""
    run = Simulated(*made, None)
    run.advance(300)
    for kind in kinds():
        typed = {one.name: one.example for one in kind.parameters}
        assert "can start" in run.attack(_order("check", *kind.links, attack=kind.name, parameters=typed)), kind.name


def test_a_fork_is_the_same_future(shipped: Callable[..., Scenario]) -> None:
    """Two futures of one moment have the same bits, one is attacked alone, and a response is remembered, too."""
    for name in ("gallo_six_dgu_joint", "gallo_six_dgu_combined"):
        scenario = shipped(name, "attacks=[]")
        run = LiveRun.of(scenario, design_scenario(scenario))
        run.advance(400)
        twin, other = run.fork(), run.fork()
        other.start(Link(1, 2), "bias", {"bias": [0.0, 5.0, 0.0], "anyway": True})
        futures = [one.advance(60) for one in (other, run, twin)]
        for field in ("residual", "threshold", "alarm", "estimate"):
            one, two = (getattr(future.links, field) for future in futures[1:])
            assert np.array_equal(one, two, equal_nan=True), (name, field)
        assert np.array_equal(futures[1].block.x, futures[2].block.x)
        assert not np.array_equal(futures[0].block.x, futures[1].block.x)
