"""What is valid and hardly meant."""

import warnings

import pytest

from bags.watch.scenarios import concerns as all_concerns
from bags.watch.scenarios import load_scenario
from bags.wire.settings import settings_of
from dcmg.shipped import scenario_path, shipped_scenarios
from dgu_sim.attacks import build_attack
from dgu_sim.errors import AttackError, ScenarioError
from dgu_sim.grid import Link
from dgu_sim.plausible import RANGES, concerns
from dgu_sim.relay import Origin
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import relay_of

BIAS = {"bias": [0.1, 0.1, 0.1]}


def _loaded(*overrides: str) -> Scenario:
    return load_scenario(scenario_path("gallo_six_dgu"), overrides)


@pytest.mark.parametrize("name", sorted(shipped_scenarios()))
def test_shipped_scenarios_raise_no_concern(name: str) -> None:
    """What we ship is meant as it is written."""
    assert all_concerns(load_scenario(scenario_path(name))) == ()


@pytest.mark.parametrize(
    ("override", "expected", "implausible"),
    [
        ("dgus.0.capacitance_f=2100", "dgus.0.capacitance_f = 2100: expected 1e-06 to 10 F", True),
        ("dgus.1.reference_v=48000", "dgus.1.reference_v = 48000: expected 1 to 1500 V", True),
        ("lines.2.resistance_ohm=500", "lines.2.resistance_ohm = 500: expected 0.0001 to 100 ohm", True),
        (
            "dgus.0.load=[{kind: gaussian, mean_a: 1, std_a: 2e4}]",
            "dgus.0.load.0.std_a = 20000: expected 0 to 10000 A",
            True,
        ),
        ("dgus.0.initial_state=[48000, 1, 1]", "dgus.0.initial_state.0 = 48000: expected 0 to 10000 V, A", True),
        ("noise={kind: student, scale: [0, 150, 0]}", "noise.scale.1 = 150: expected 0 to 100 V, A or V s", True),
        ("history.samples=20000000", "history.samples = 2e+07: expected 2 to 1e+06 samples", True),
        ("history.load_spread_a=2e4", "history.load_spread_a = 20000: expected 0 to 10000 A", True),
        ("duration_sec=1.2345", "duration_sec = 1.2345: no multiple of sampling_period_sec = 0.01", False),
        (
            "attacks=[{kind: freeze, link: 1-2, start_sec: 60}]",
            "attacks.0.start_sec = 60: the run ends at 10 s: this attack never begins",
            False,
        ),
        ("lines=[{between: [1, 2], resistance_ohm: 0.05}]", "lines: the grid falls into 5 parts, {1, 2}, {3}", False),
    ],
)
def test_what_is_hardly_meant_is_said(override: str, expected: str, *, implausible: bool) -> None:
    """Each concern names key, value and reason; a wrong unit is told from what only deserves a note."""
    changes = (override,) if "attacks" in override else (override, "attacks=[]")
    (found,) = concerns(_loaded(*changes))
    assert expected in found.text
    assert found.implausible == implausible


def test_a_run_that_nobody_watches_says_so() -> None:
    """The detectors learn until after its end."""
    (found,) = all_concerns(_loaded("attacks=[]", "duration_sec=2"))
    assert found.text == "duration_sec = 2: the detectors learn until 2.5 s: nothing is watched"


def test_currents_of_a_table_are_judged_as_they_act() -> None:
    """A table in mA with a factor is no concern; the same without it is."""
    table = "dgus.0.load=[{{kind: table, time_sec: [0, 1], current_a: [20000, 30000], scale: {}}}]"
    assert concerns(_loaded("attacks=[]", table.format(0.001))) == ()
    (found,) = concerns(_loaded("attacks=[]", table.format(1)))
    assert "dgus.0.load.0.current_a = 30000" in found.text


def test_ranges_can_be_others() -> None:
    """Whoever has such a capacitor says so."""
    wider = {**RANGES, "dgus.capacitance_f": (1e-6, 3000.0, "F")}
    assert concerns(_loaded("dgus.0.capacitance_f=2100", "attacks=[]"), wider) == ()


@pytest.mark.parametrize("key", ["dgus.0.reference_v", "duration_sec", "dgus.0.rated_current_a"])
def test_numbers_that_overflow_are_refused_in_a_line(key: str) -> None:
    """1e308 names its key, and numpy does not warn before."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(ScenarioError, match=rf"{key} = '1e308': expected a number of at most 1e15"):
            _loaded(f"{key}=1e308")


def test_an_attack_by_hand_waits_for_the_detectors() -> None:
    """While detectors learn it is refused with the time, or started anyway; afterwards it starts."""
    scenario = _loaded("attacks=[]")
    ready = settings_of(scenario).calibrated_sec
    assert ready > 0.0
    relay, state = relay_of(scenario, ready_sec=ready)
    with pytest.raises(AttackError, match=rf"until {ready:g} s the detectors learn"):
        relay.start(state, Link(1, 2), "bias", BIAS)
    started, event = relay.start(state, Link(1, 2), "bias", {**BIAS, "anyway": True})
    assert (event.step, event.origin) == (0, Origin.SERVICE)
    assert started.attacks[0].attack == build_attack("bias", BIAS)
    late = type(state)(step=round(ready / 0.01), attacks=(), next_number=1)
    assert relay.start(late, Link(1, 2), "bias", BIAS)[1].step == round(ready / 0.01)
