"""Poisoned histories: what a certificate says of them, and which attack then evades; the table of attacks.md."""

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bags.watch.histories import histories_of_run, recorded_states, true_histories, write_histories
from bags.wire.convert import history_of
from dgu_sim.errors import AttackError, ScenarioError
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import relay_of, simulate
from monitor.observers import Design, Observer, design

BIAS = np.array([0.0, 0.5, 0.0])
POISONS = {
    "`scale` by (1, 0.9, 1)": "{kind: scale, dgu: 1, gain: [1, 0.9, 1]}",
    "`rotate` by 0.1 rad": "{kind: rotate, dgu: 1, angle_rad: 0.1}",
    "`noise` of 1e-6": "{kind: noise, dgu: 1, std: [1e-6, 1e-6, 1e-6]}",
    "`noise` of 0.01": "{kind: noise, dgu: 1, std: [0.01, 0.01, 0.01]}",
    "`inject` (0, 0.5, 0)": "{kind: inject, dgu: 1, direction: [0, 0.5, 0]}",
    "`hide` (0, 0.5, 0)": "{kind: hide, dgu: 1, bias: [0, 0.5, 0]}",
}
GIVEN = {"unknown_inputs": 2}


@pytest.fixture(name="designed")
def _designed(shipped: Callable[..., Scenario]) -> Callable[..., Design]:
    """Design T's UIO from the history of DGU 1 as it reaches the monitors."""

    def make(poison: str | None, options: dict[str, Any]) -> Design:
        scenario = shipped("gallo_six_dgu", f"poison=[{poison or ''}]")
        return design("full_order", history_of(histories_of_run(scenario, 1)), options)

    return make


def _observer(found: Design) -> Observer:
    assert found.observer is not None
    return found.observer


def _residuals(observer: Observer, received: Sequence[Sequence[float]] | NDArray[np.float64]) -> NDArray[np.float64]:
    state, residuals = observer.init((), tuple(received[0])), []
    for y in received:
        state, estimate = observer.step(state, (), tuple(y))
        residuals.append(estimate.residual)
    return np.array(residuals)


def _shown(observer: Observer, phi: NDArray[np.float64]) -> float:
    """Largest residual that a falsification phi (steps, 3) causes: observers are linear."""
    return float(np.abs(_residuals(observer, phi)).max())


def _switched(bias: NDArray[np.float64], signs: Sequence[float]) -> NDArray[np.float64]:
    """Nothing for ten samples, then multiples of a bias."""
    return np.concatenate([np.zeros((10, 3)), np.outer(signs, bias)])


@pytest.mark.parametrize("poison", POISONS)
def test_table_says_what_the_certificates_say(root: Path, designed: Callable[..., Design], poison: str) -> None:
    """Accepted or refused, with nothing known and with the number of unknown inputs given."""
    page = (root / "docs" / "attacks.md").read_text(encoding="utf-8")
    ((free, given),) = re.findall(rf"^\| {re.escape(poison)} \| (\w+) \| (\w+) \|", page, flags=re.MULTILINE)
    for options, said in (({}, free), (GIVEN, given)):
        assert designed(POISONS[poison], options).accepted == (said == "accepted")


@pytest.mark.parametrize("options", [{}, GIVEN])
def test_a_hidden_bias_leaves_no_residual_and_rest_shows_nothing(
    designed: Callable[..., Design], shipped: Callable[..., Scenario], options: dict[str, Any]
) -> None:
    """Steady or switching, the bias is invisible from its first sample; an honest design shows it at once."""
    fooled = _observer(designed(POISONS["`hide` (0, 0.5, 0)"], options))
    honest = _observer(designed(None, options))
    attack = _switched(BIAS, [1.0, 1.0, -1.0, 1.0, 3.0, 0.0, -2.0] * 5)
    assert _shown(fooled, attack) < 1e-9
    assert _shown(honest, attack) > 1e-4
    scenario = shipped("gallo_six_dgu", "attacks=[]", "secondary.enabled=false", "duration_sec=1")
    (block,) = simulate(scenario)
    assert np.abs(_residuals(fooled, block.y[:, 0, 0])).max() < 1e-9
    loaded = "dgus.0.load=[{kind: constant, current_a: 10}, {kind: step, current_a: 1, at_sec: 0.5}]"
    (block,) = simulate(shipped("gallo_six_dgu", "attacks=[]", "secondary.enabled=false", "duration_sec=1", loaded))
    assert np.abs(_residuals(fooled, block.y[:, 0, 0])).max() > 1e-4
    assert np.abs(_residuals(honest, block.y[:, 0, 0])).max() < 1e-9


def test_a_hidden_bias_evades_the_run_and_moves_the_grid(shipped: Callable[..., Scenario]) -> None:
    """In a run the residual with the attack differs from the one without by less than 1e-9 plus what the grid does."""
    poison = f"poison=[{POISONS['`hide` (0, 0.5, 0)']}]"
    attack = "{kind: bias, link: 1-2, start_sec: 3, bias: [0, 0.5, 0]}"
    scenario = shipped("gallo_six_dgu", "duration_sec=8", poison, f"attacks=[{attack}]")
    fooled = _observer(design("full_order", history_of(histories_of_run(scenario, 1)), {}))
    (block,) = simulate(scenario)
    link = [str(one) for one in scenario.links].index("1-2")
    told, true = (_residuals(fooled, y[:, 0, p]) for y, p in ((block.received, link), (block.y, 0)))
    assert np.abs(told - true).max() < 1e-9
    assert block.x[-1, 0, :, 0].mean() - 48.0 == pytest.approx(0.1 * 0.5 / 6.0 * 5.0, rel=0.1)


def test_scaled_history_fits_a_scaled_link(designed: Callable[..., Design], shipped: Callable[..., Scenario]) -> None:
    """Record and messages falsified alike: the residual is at rounding, whatever the loads do."""
    fooled = _observer(designed(POISONS["`scale` by (1, 0.9, 1)"], {}))
    load = "dgus.0.load=[{kind: constant, current_a: 10}, {kind: uniform, low_a: -1, high_a: 1}]"
    (block,) = simulate(shipped("gallo_six_dgu", "attacks=[]", "duration_sec=2", load))
    y = block.y[:, 0, 0]
    assert np.abs(_residuals(fooled, y * [1.0, 0.9, 1.0])).max() < 1e-9
    assert np.abs(_residuals(fooled, y)).max() > 1e-3


def test_an_injected_direction_is_all_but_lost(designed: Callable[..., Design]) -> None:
    """Told that there are two unknown inputs, the design drops the weaker true one: the injected one stays unseen."""
    fooled = _observer(designed(POISONS["`inject` (0, 0.5, 0)"], GIVEN))
    attack = _switched(BIAS, [1.0, -1.0, 1.0, 1.0, -3.0] * 5)
    assert _shown(fooled, attack) < 0.02 * _shown(_observer(designed(None, GIVEN)), attack)


def test_other_dgus_and_the_attackers_keep_the_true_record(shipped: Callable[..., Scenario]) -> None:
    """Only the named DGU's history changes, and what hides from it is computed from the true one."""
    attack = "attacks=[{kind: uio_stealthy_trajectory, link: 1-2, current_a: 0.5, start_sec: 3}]"
    scenario = shipped("gallo_six_dgu", "duration_sec=4", f"poison=[{POISONS['`rotate` by 0.1 rad']}]", attack)
    assert np.array_equal(histories_of_run(scenario, 2)[0].x, true_histories(scenario, 2)[0].x)
    assert not np.array_equal(histories_of_run(scenario, 1)[0].x, true_histories(scenario, 1)[0].x)
    (block,), (clean,) = simulate(scenario), simulate(shipped("gallo_six_dgu", "duration_sec=4", attack))
    assert np.array_equal(block.received, clean.received)


def test_attackers_know_the_history_that_is_in_the_bag(shipped: Callable[..., Scenario], tmp_path: Path) -> None:
    """With history.bag they hide from what was recorded there; unread it is asked for in one line."""
    attack = "attacks=[{kind: uio_stealthy_plane, link: 1-2, current_a: 0.5, start_sec: 3}]"
    other = shipped("gallo_six_dgu", "history.noise_std=0.01", "history.samples=60", "seed=9")
    bag = write_histories(other, [1], tmp_path / "histories")
    scenario = shipped("gallo_six_dgu", "duration_sec=4", f"history.bag={bag}", attack)
    with pytest.raises(AttackError, match="the history of DGU 1 is in"):
        relay_of(scenario)
    recorded = recorded_states(scenario)
    assert recorded is not None
    assert [np.array_equal(one, true.x) for one, true in zip(recorded[1], true_histories(scenario, 1), strict=True)]
    relay_of(scenario, recorded=recorded)


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("poison=[{kind: scale, dgu: 9, gain: [1, 1, 1]}]", "poison.0.dgu = 9: expected one of the DGUs 1, 2"),
        ("poison=[{kind: nope, dgu: 1}]", "poison.0.kind = 'nope': expected one of"),
        ("attacks=[{kind: covert, link: 3-1, start_sec: 3}]", "DGU 3 keeps v, and covert starts from whole samples"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(shipped: Callable[..., Scenario], override: str, said: str) -> None:
    """Unknown DGUs and kinds, and a replica of a DGU that hides something."""
    with pytest.raises(ScenarioError) as caught:
        shipped("gallo_six_dgu_partial", override)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_bias_along_the_state_at_rest_cannot_be_hidden(shipped: Callable[..., Scenario]) -> None:
    """It would be another state at rest."""
    scenario = shipped("gallo_six_dgu", "poison=[{kind: hide, dgu: 1, bias: [0, 0, 0]}]")
    with pytest.raises(ScenarioError, match="poison of DGU 1: bias"):
        histories_of_run(scenario, 1)
