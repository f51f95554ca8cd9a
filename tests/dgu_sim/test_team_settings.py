"""The section monitor.team: what is refused, and with which words; the experiment on the whole grid."""

from collections.abc import Callable

import numpy as np
import pytest

from dgu_sim.errors import ScenarioError
from dgu_sim.grid_experiment import run_grid_experiments
from dgu_sim.scenario import Scenario
from dgu_sim.stability import sampled_grid

LIE = "{member: 3, kind: lies, start_sec: 4.5, bias: [1, 0, 0]}"
WRONG = {
    "links: [[1, 2], [2, 3]]": r"links = .*: expected a connected graph \(assumption 1 of D\), found no path from "
    "member 1 to 4, 5, 6",
    "links: [[1, 1]]": "links.0 = .1, 1.: expected two different DGUs of 1, 2, 3, 4, 5, 6",
    "links: [[1, 2], [2, 1]]": "links.1 = .2, 1.: expected a pair that does not stand before it",
    "structure: leader, leader: 9": "leader = 9: expected one of the members 1, 2, 3, 4, 5, 6: without a leader",
    "leader: 1": "leader = 1: expected structure leader: in a mutual team nobody leads",
    "events: [{member: 7, kind: leaves, start_sec: 1}]": "events.0.member = 7: expected one of 1, 2, 3, 4, 5, 6",
    "events: [{member: 3, kind: lies, start_sec: 5}]": "events.0.bias = None: expected 3 numbers for lies",
    "events: [{member: 3, kind: leaves, start_sec: 5, stop_sec: 6}]": "stop_sec = 6.0: expected it for lies alone",
    "events: [{member: 1, kind: joins, start_sec: 1}, " + LIE + "]": "events.1.start_sec = 4.5: expected at least 5",
    "events: [{member: 1, kind: leaves, start_sec: 1}, {member: 1, kind: leaves, start_sec: 2}]": "expected joins and "
    "leaves of one member in turn",
    "settle_sec: 5": r"attacks.0.start_sec = 5.0: expected at least 7: until then the team calibrates",
}


@pytest.mark.parametrize("section", WRONG)
def test_what_cannot_be_is_refused_in_one_line(shipped: Callable[..., Scenario], section: str) -> None:
    """The line names the key, the value and what was expected."""
    with pytest.raises(ScenarioError, match=WRONG[section]) as caught:
        shipped("gallo_six_dgu", f"monitor.team={{{section}}}")
    assert "\n" not in str(caught.value)


def test_a_team_needs_a_grid(shipped: Callable[..., Scenario]) -> None:
    """DGUs without lines have nothing in common to estimate."""
    with pytest.raises(ScenarioError, match=r"monitor\.team = 'on': expected one connected grid"):
        shipped("isolated_dgu_1", "monitor.team={}")


@pytest.mark.parametrize("coupling", ["held", "joint"])
def test_the_experiment_is_on_the_grid_as_it_runs(shipped: Callable[..., Scenario], coupling: str) -> None:
    """All states and inputs of all DGUs at the same instants obey x+ = A x + E u of the coupling of the run."""
    scenario = shipped("team_six_dgu", f"coupling={coupling}", "history.experiments=2")
    A, E = sampled_grid(scenario.grid, scenario.coupling, scenario.sampling_period_sec)
    first, second = run_grid_experiments(scenario, 120)
    assert first.x.shape == (120, 18)
    assert first.u.shape == (120, 12)
    assert not np.array_equal(first.u, second.u)
    np.testing.assert_allclose(first.x[1:], first.x[:-1] @ A.T + first.u[:-1] @ E.T, atol=1e-9)
    assert np.array_equal(run_grid_experiments(scenario, 120)[1].x, second.x)


def test_what_is_not_sent_is_not_in_the_outputs(shipped: Callable[..., Scenario]) -> None:
    """DGU 3 keeps v for itself: NaN in its outputs, known in its states; noise and precision are those of `history`."""
    changes = ("dgus.2.output=[V, I_t]", "history.noise_std=0.1", "history.precision=float32")
    (found,) = run_grid_experiments(shipped("team_six_dgu", *changes), 120)
    assert np.flatnonzero(np.isnan(found.y).all(axis=0)).tolist() == [8]
    assert np.isfinite(found.x).all()
    assert np.array_equal(found.x, found.x.astype(np.float32).astype(np.float64))
