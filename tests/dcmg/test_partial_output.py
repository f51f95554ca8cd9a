"""A run with reduced-order observers, where one neighbour sends only part of its state."""

import json
from pathlib import Path

import numpy as np

from bags.runs.offline import simulate_to_bag
from bags.runs.reader import read_run
from bags.runs.replay import replay
from bags.watch.scenarios import load_scenario
from dcmg.shipped import scenario_path
from monitor.detectors import Phase


def test_reduced_order_monitors_estimate_what_is_not_sent(tmp_path: Path) -> None:
    """Links from DGU 3 are honestly REFUSED but still estimate v; the others notice the attack; replay agrees."""
    scenario = load_scenario(scenario_path("gallo_six_dgu_partial"), ["duration_sec=6.0"])
    record = read_run(simulate_to_bag(scenario, tmp_path / "bag"))
    for position, link in enumerate(record.links):
        estimate, truth = record.estimate[300:500, position], record.x[300:500, link.source - 1]
        np.testing.assert_allclose(estimate, truth, rtol=0.0, atol=1e-9)  # errors have died out, data are exact
        blind = link.source == 3
        assert (record.phase[-1, position] == Phase.REFUSED.value) == blind
        assert np.isnan(record.residual[:, position]).all() == blind
        assert record.alarm[:, position].any() == ((link.source, link.target) == (1, 2))
    np.testing.assert_array_equal(replay(record).residual, record.residual)


def test_delayed_monitors_bound_what_one_output_cannot_tell(tmp_path: Path) -> None:
    """V only from DGU 3: estimates one step late within the guaranteed bound; both attacks are noticed."""
    scenario = load_scenario(scenario_path("gallo_six_dgu_voltage_only"), ["duration_sec=6.0"])
    record = read_run(simulate_to_bag(scenario, tmp_path / "bag"))
    for position, link in enumerate(record.links):
        design = record.designs[link]
        assert design.lag == 1
        error = np.linalg.norm(record.estimate[300:500, position] - record.x[299:499, link.source - 1], axis=1)
        guarantee = json.loads(design.certificate)["guarantee"]
        # the loads of the run are constant: they are no larger than the unknown inputs of the history
        assert np.max(error) <= guarantee["response_bound"] + 1e-9
        assert guarantee["exact"] == (link.source != 3)
        assert record.alarm[:, position].any() == ((link.source, link.target) in {(1, 2), (3, 4)})
    np.testing.assert_array_equal(replay(record).residual, record.residual)
