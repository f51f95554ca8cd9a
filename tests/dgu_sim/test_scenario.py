"""Reading scenarios."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bags.watch.scenarios import load_scenario, parse_scenario
from bags.wire.settings import settings_of
from dgu_sim.errors import ScenarioError
from dgu_sim.grid import Link
from dgu_sim.loads import ConstantLoad, TableLoad
from dgu_sim.plant import Coupling
from dgu_sim.relay import AttackPlan
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import simulate

GALLO_LINES = {
    (1, 2): (0.05, 2.1e-6),
    (1, 3): (0.07, 1.8e-6),
    (1, 6): (0.10, 2.5e-6),
    (2, 4): (0.04, 2.3e-6),
    (3, 4): (0.06, 1.0e-6),
    (4, 5): (0.08, 1.8e-6),
    (5, 6): (0.08, 3.0e-6),
}
GALLO_DGUS = {
    1: (0.2, 1.8, 2.2, -2.134, -0.163, 13.553, 10.0),
    2: (0.3, 2.0, 1.9, -0.869, -0.050, 48.285, 12.0),
    3: (0.1, 2.2, 1.7, -0.480, -0.108, 30.673, 15.0),
    4: (0.5, 3.0, 2.5, -6.990, -0.175, 102.960, 13.0),
    5: (0.4, 1.3, 2.0, -0.101, -0.010, 16.393, 18.0),
    6: (0.6, 2.5, 3.0, -2.134, -0.163, 13.553, 16.0),
}


def test_shipped_scenarios_load_round_trip_and_start(scenario_files: list[Path]) -> None:
    """Each one loads, its resolved text gives the same scenario again, and it runs."""
    assert len(scenario_files) >= 4
    for path in scenario_files:
        scenario = load_scenario(path)
        assert scenario.name == path.stem
        assert scenario.description
        again = parse_scenario(scenario.to_yaml())
        assert again == scenario
        assert again.to_yaml() == scenario.to_yaml()
        block = next(simulate(scenario))
        assert np.isfinite(block.x).all()


def test_gallo_has_the_published_numbers(shipped: Callable[..., Scenario]) -> None:
    """Parameters, loads and lines are those of theory.md section 1."""
    scenario = shipped("gallo_six_dgu")
    for number, (R_t, L_t, C_t, k1, k2, k3, load) in GALLO_DGUS.items():
        dgu = scenario.dgu(number)
        found = (dgu.resistance_ohm, dgu.inductance_h, dgu.capacitance_f, dgu.k1, dgu.k2, dgu.k3, dgu.nominal_load)
        assert found == pytest.approx((R_t, 1e-3 * L_t, 1e-3 * C_t, k1, k2, k3, load), rel=1e-12)
        assert dgu.reference_v == 48.0
    assert {line.between: (line.resistance_ohm, line.inductance_h) for line in scenario.lines} == GALLO_LINES
    assert (scenario.coupling, scenario.secondary.gain) == (Coupling.HELD, 0.1)
    assert (scenario.steps, scenario.sampling_period_ns, len(scenario.links)) == (1000, 10_000_000, 14)
    expected = AttackPlan(parameters={"bias": [0.1, 0.1, 0.1]}, links=(Link(1, 2),), kind="bias", start_sec=5.0)
    assert [attack.plan for attack in scenario.attacks] == [expected]


def test_consensus_is_the_second_parameter_set(shipped: Callable[..., Scenario]) -> None:
    """Lines have ten times the resistance; references, ratings and currents are the published ones."""
    scenario = shipped("consensus_six_dgu")
    for line in scenario.lines:
        assert line.resistance_ohm == pytest.approx(10.0 * GALLO_LINES[line.between][0])
    assert [dgu.reference_v for dgu in scenario.dgus] == [47.0, 48.0, 45.0, 50.0, 46.0, 49.0]
    assert [dgu.rated_current_a for dgu in scenario.dgus] == [1.0, 1.25, 1.5, 1.75, 2.0, 2.25]
    currents = [dgu.nominal_load for dgu in scenario.dgus]
    assert currents == pytest.approx([value / 3.0 for value in (5.0, 6.0, 7.0, 6.5, 8.0, 7.5)], abs=1e-6)


def test_overrides_replace_add_and_index(shipped: Callable[..., Scenario]) -> None:
    """A key is replaced, a missing section made, a list entry reached by its index; values are YAML."""
    scenario = shipped(
        "gallo_six_dgu", "secondary.gain=0.05", "dgus.0.reference_v=47", "history.samples=40", "attacks=[]"
    )
    assert scenario.secondary.gain == 0.05
    assert scenario.dgus[0].reference_v == 47.0
    assert scenario.history.samples == 40
    assert scenario.attacks == ()


def test_detector_defaults_are_filled_in(shipped: Callable[..., Scenario]) -> None:
    """What a scenario leaves out of the fixed detector's options stands in the resolved one."""
    options = settings_of(shipped("gallo_six_dgu", "monitor.detector.options={margin: 4}")).detector.options
    assert options == {"settle_sec": 0.5, "calibrate_sec": 2.0, "margin": 4, "floor": 1e-6}
    assert settings_of(shipped("gallo_six_dgu")).detector.calibrated_sec == 2.5


def test_numbers_may_be_written_the_way_people_write_them(shipped: Callable[..., Scenario]) -> None:
    """YAML 1.1 takes 2e-3 for text; a scenario takes it for a number."""
    assert shipped("gallo_six_dgu", "dgus.0.inductance_h=2e-3").dgus[0].inductance_h == 2e-3


def test_csv_table_is_embedded(shipped: Callable[..., Scenario], tmp_path: Path) -> None:
    """A table is read beside the scenario; the resolved scenario holds its values and needs no file."""
    (tmp_path / "load.csv").write_text("time_sec, current_a\n0,10\n0.5,12.5\n", encoding="utf-8")
    path = tmp_path / "mine.yaml"
    path.write_text(shipped("gallo_six_dgu").to_yaml(), encoding="utf-8")
    scenario = load_scenario(path, ["dgus.1.load=[{kind: table, file: load.csv}]"])
    assert scenario.dgus[1].load == (TableLoad(kind="table", time_sec=(0.0, 0.5), current_a=(10.0, 12.5)),)
    assert parse_scenario(scenario.to_yaml()) == scenario


def test_scenarios_are_frozen(shipped: Callable[..., Scenario]) -> None:
    """Nothing can be changed after checking."""
    scenario = shipped("gallo_six_dgu")
    with pytest.raises(ValueError, match="frozen"):
        scenario.seed = 2
    with pytest.raises(ValueError, match="frozen"):
        scenario.dgus[0].load[0].current_a = 3.0  # type: ignore[union-attr]  # the kind of load is not the point


def test_unknown_dgu_is_named(shipped: Callable[..., Scenario]) -> None:
    """Asking for a DGU that is not there lists those that are."""
    with pytest.raises(ScenarioError, match="DGU 7: expected one of 1, 2, 3, 4, 5, 6"):
        shipped("gallo_six_dgu").dgu(7)


def test_load_is_constant_by_default_kind(shipped: Callable[..., Scenario]) -> None:
    """The shipped loads are constant currents."""
    assert shipped("gallo_six_dgu").dgus[0].load == (ConstantLoad(kind="constant", current_a=10.0),)
