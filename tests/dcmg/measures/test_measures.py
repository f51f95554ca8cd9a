"""The measurements of `dcmg measure`, at a small size; docs/detectors.md and docs/attacks.md hold the whole ones."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from typer.testing import CliRunner

from bags.runs.following import follow_many
from bags.watch.monitors import link_monitors
from bags.watch.scenarios import load_scenario
from dcmg.commands.measure import MEASURES, app
from dcmg.measures import damage, false_alarms, roc
from dcmg.shipped import scenario_path
from dgu_sim.errors import AttackError
from dgu_sim.simulate import simulate
from dgu_sim.stealthy_damage import Goal, Limits, largest_damage, responses_of

if TYPE_CHECKING:
    from pathlib import Path


def test_many_runs_at_once_are_each_run_alone() -> None:
    """Watched side by side, a run has the bits of a run of its own."""
    scenario = load_scenario(
        scenario_path("gallo_six_dgu"), [f"noise={false_alarms.NOISE['student']}", "duration_sec=4"]
    )
    parts = list(follow_many(scenario, (3, 8), 150))
    monitors = link_monitors(scenario)
    (block,) = simulate(scenario, (8,), scenario.steps)
    _, alone = monitors.run(monitors.init(), block.received[:, 0], block.delivered[:, 0])
    for name in ("residual", "threshold", "alarm", "phase"):
        together = np.concatenate([getattr(part.links, name) for part in parts])[:, 1]
        np.testing.assert_array_equal(together, getattr(alone, name))


@pytest.mark.parametrize("coupling", false_alarms.COUPLINGS)
def test_noise_bound_never_alarms_within_its_bounds(coupling: str) -> None:
    """60 000 armed samples on the grid with random loads; the floor of `joint` covers what the design does not hold."""
    scenario = false_alarms.scenario_of(coupling, "uniform", "{kind: fixed}", 1.0, 0)
    floor = [1.001 * one + 1e-9 for one in false_alarms.coupling_floor(scenario)]
    detector = f"{{kind: noise_bound, options: {{noise: {false_alarms.BOUND}, floor: {floor}}}}}"
    scenario = false_alarms.scenario_of(coupling, "uniform", detector, 5.5, 0)
    case = false_alarms.case_of("noise_bound", scenario, "uniform", range(1, 21))
    assert (case.samples, case.alarms) == (60_000, 0)
    assert (max(floor) < 2e-9) == (coupling == "held")


def test_without_its_floor_noise_bound_is_wrong_on_the_joint_grid() -> None:
    """Where the design does not hold, the promise does not either: loads alone raise alarms."""
    detector = "{kind: noise_bound, options: {noise: 1e-4}}"
    scenario = false_alarms.scenario_of("joint", "uniform", detector, 3.0, 0)
    quiet = scenario.model_copy(update={"noise": load_scenario(scenario_path("gallo_six_dgu")).noise})
    assert false_alarms.case_of("noise_bound", quiet, "none", (1, 2)).alarms > 0


def test_biases_on_the_joint_grid_stand_out_of_the_loads(tmp_path: Path) -> None:
    """(0.1, 0.1, 0.1) all but never hides in the loads; every area has its interval, and there is a figure.

    The joint record of DGU 6 is too noisy for two unknown inputs: its design is refused, and no curve is drawn.
    """
    curves = roc.run(1, runs=4, sizes=(0.1,))
    drawn = {name: {curve.source for curve in curves if curve.history == name} for name in roc.HISTORIES}
    assert drawn == {"held experiment": {1, 2, 3, 4, 5, 6}, "joint experiment": {1, 2, 3, 4, 5}}
    for one in curves[::6]:
        area = one.area()
        assert area.value > 0.99
        assert area.interval is None or 0.99 < area.interval.low <= area.value <= area.interval.high <= 1.0
        assert one.seen_at(1.0) >= one.seen_at(0.01)
    assert len(roc.notes(curves[:1])) == 3
    assert roc.plot(curves, tmp_path)[0].exists()


def test_the_worst_hidden_attack_does_what_it_should_unseen(tmp_path: Path) -> None:
    """The run has the damage of the linear programme, no residual and no alarm."""
    shown = damage.run(1, horizon_sec=2.0, rise_sec=1.0, names=("usual",))
    assert all(check.ok for check in damage.checks(shown))
    assert damage.plot(shown, tmp_path)[0].exists()
    assert [one.damage.goal for one in shown] == list(Goal)
    assert shown[0].value <= damage.LIMITS["usual"].reference_v


def test_nothing_beyond_the_limits_is_claimed() -> None:
    """Every constraint holds at the optimum, and one of them is tight."""
    responses = responses_of(load_scenario(scenario_path("gallo_six_dgu")), 2.5, 1.5, 1.0)
    limits = Limits(load_a=2.0, load_rate_a=0.5, reference_v=0.3, reference_rate_v=0.05)
    found = largest_damage(responses, limits, Goal.SHARING)
    phi = np.array([found.currents.get(link, 0.0) for link in responses.links])
    used = [
        np.abs(responses.claimed[:, 0] * phi).max() / limits.load_a,
        np.abs(responses.claimed_rate[0] * phi).max() / limits.load_rate_a,
        np.abs(responses.claimed_rate[1] * phi).max() / limits.reference_rate_v,
        np.abs(responses.alpha @ phi).max() / limits.reference_v,
    ]
    assert max(used) == pytest.approx(1.0, abs=1e-6)
    wider = Limits(load_a=4.0, load_rate_a=1.0, reference_v=0.6, reference_rate_v=0.1)
    for goal in Goal:  # twice the limits, twice the damage
        narrow, wide = (largest_damage(responses, one, goal).value for one in (limits, wider))
        assert wide == pytest.approx(2.0 * narrow, rel=1e-6)
    with pytest.raises(AttackError, match="limit 0: expected a positive number"):
        largest_damage(responses, Limits(load_a=0.0, load_rate_a=1, reference_v=1, reference_rate_v=1), Goal.SHARING)


def test_command_prints_and_writes(tmp_path: Path) -> None:
    """`dcmg measure impact` prints its table; the formulas of theory section 2 hold within 1 %."""
    done = CliRunner().invoke(app, ["impact", "--out", str(tmp_path), "--json"])
    assert done.exit_code == 0, done.output
    document = json.loads(done.output)
    assert len(document["checks"]) == 4
    assert all(check["ok"] for check in document["checks"])
    assert all(name in CliRunner().invoke(app, ["list"]).output for name in MEASURES)
