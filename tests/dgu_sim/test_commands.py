"""Commands: what they may say, and what they change of a DGU."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dgu_sim.commands import COMMANDS, Command, LoadRamp, LoadSet, LoadStep, ReferenceSet, parse_command
from dgu_sim.errors import ScenarioError, SteeringError
from dgu_sim.scenario import Scenario, parse_scenario
from dgu_sim.script import Script
from dgu_sim.simulate import simulate
from dgu_sim.steering import DguSteering, GridSteering

EXAMPLES: Mapping[str, Mapping[str, object]] = {
    "clock_pause": {},
    "clock_resume": {},
    "clock_step": {"steps": 3},
    "clock_rate": {"rate": 0.5},
    "load_set": {"dgu": 1, "current_a": 9.0},
    "load_step": {"dgu": 1, "current_a": -1.0},
    "load_ramp": {"dgu": 2, "current_a": 1.5, "ramp_sec": 0.5},
    "reference_set": {"dgu": 2, "voltage_v": 47.5},
    "detector_threshold": {"link": "1-2", "threshold": [0.1, 0.2, 0.3]},
    "detector_recalibrate": {"dgu": 2},
    "detector_on": {"link": "2-1"},
    "detector_off": {"dgu": 1},
    "response_on": {},
    "response_off": {"dgu": 1},
    "attack_start": {"kind": "bias", "links": ["1-2"], "parameters": {"bias": [0.1, 0.0, 0.0]}},
    "attack_change": {"kind": "freeze", "links": ["1-2"]},
    "attack_stop": {"link": "1-2"},
}
REFUSED = [
    ({"command": "load_sett", "dgu": 1}, "did you mean load_set?"),
    ({}, "command = None: expected one of clock_pause"),
    ({"command": "load_set", "dgu": 1}, "load_set: current_a: this key is missing"),
    ({"command": "load_set", "dgu": 1, "current_a": float("nan")}, "load_set: current_a = nan: expected a finite"),
    ({"command": "load_set", "dgu": 1, "curent_a": 1}, "did you mean current_a?"),
    ({"command": "load_ramp", "dgu": 1, "current_a": 1, "ramp_sec": 0}, "load_ramp: ramp_sec = 0: expected a number"),
    ({"command": "detector_off"}, "expected either link or dgu, found neither"),
    ({"command": "detector_off", "link": "1-2", "dgu": 2}, "expected either link or dgu, found both"),
    ({"command": "detector_off", "link": "12"}, "detector_off: link = '12': expected SOURCE-TARGET"),
    ({"command": "detector_threshold", "dgu": 1, "threshold": [1, 2]}, "expected one number, or 3"),
    ({"command": "attack_start", "kind": "byas", "links": ["1-2"]}, "did you mean bias?"),
    ({"command": "attack_start", "kind": "bias", "links": ["1-2"]}, "attack_start: bias: this key is missing"),
    ({"command": "clock_step", "steps": 0}, "clock_step: steps = 0"),
    ({"command": "clock_rate", "rate": -1}, "clock_rate: rate = -1"),
]
CURRENT = st.floats(-50.0, 50.0)
ON_A_DGU: st.SearchStrategy[Command] = st.one_of(
    st.builds(LoadSet, dgu=st.integers(1, 4), current_a=CURRENT),
    st.builds(LoadStep, dgu=st.integers(1, 4), current_a=CURRENT),
    st.builds(LoadRamp, dgu=st.integers(1, 4), current_a=CURRENT, ramp_sec=st.floats(0.001, 0.2)),
    st.builds(ReferenceSet, dgu=st.integers(1, 4), voltage_v=CURRENT),
)


@pytest.fixture(name="six", scope="module")
def _six(shipped: Callable[..., Scenario]) -> Scenario:
    return shipped("gallo_six_dgu", "attacks=[]")


def test_every_command_has_an_example() -> None:
    """The list below is of all commands."""
    assert EXAMPLES.keys() == COMMANDS.keys()


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_is_plain_data_and_comes_back(name: str) -> None:
    """What a script holds reads as the same command."""
    command = parse_command({"command": name, **EXAMPLES[name]})
    assert parse_command(command.document()) == command
    assert command.words.startswith(name.replace("_", " "))


@pytest.mark.parametrize(("data", "message"), REFUSED)
def test_a_wrong_command_is_refused_in_one_line(data: Mapping[str, object], message: str) -> None:
    """Name, key, value, what was expected."""
    with pytest.raises(SteeringError) as refusal:
        parse_command(data)
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("{command: clock_pause}", "script.0.step = None: expected either step or at_sec, found neither"),
        ("{step: 3, command: load_set, dgu: 7, current_a: 1}", "script.0.dgu = '7': expected one of the DGUs 1, 2, 3"),
        ("{step: 3, command: detector_off, link: 2-3}", "script.0.link = '2-3': expected a link: "),
        ("{step: 3, command: load_set, dgu: 1, current_a: x}", "script.0.current_a = 'x': expected a valid number"),
        ("{step: 3, command: fly}", "script.0.command = 'fly': expected one of clock_pause"),
    ],
)
def test_a_wrong_script_is_refused_in_one_line(six: Scenario, entry: str, message: str) -> None:
    """The line names the entry."""
    with pytest.raises(ScenarioError) as refusal:
        parse_scenario(six.to_yaml(), overrides=[f"script=[{entry}]"])
    assert message in str(refusal.value)


def test_a_scenario_without_a_script_is_written_as_before(six: Scenario) -> None:
    """And one with a script comes back."""
    assert "\nscript:" not in six.to_yaml()
    script = "script=[{at_sec: 0.1, command: attack_stop, link: 1-2}, {step: 4, command: response_off}]"
    with_script = parse_scenario(six.to_yaml(), overrides=[script])
    assert parse_scenario(with_script.to_yaml()) == with_script
    assert [step for step, _ in with_script.orders.entries] == [10, 4]


@settings(deadline=None, derandomize=True, max_examples=100)
@given(
    commands=st.lists(st.tuples(st.integers(0, 30), ON_A_DGU), max_size=6),
    drawn=st.lists(CURRENT, min_size=3, max_size=3),
)
def test_floats_and_arrays_are_steered_alike(commands: Sequence[tuple[int, Command]], drawn: Sequence[float]) -> None:
    """The bits of one DGU in floats are those of its place in an array, for several runs."""
    singles = {dgu: DguSteering(dgu=dgu, sampling_period_sec=0.01) for dgu in (1, 2, 3)}
    grid = GridSteering(dgus=(1, 2, 3), sampling_period_sec=0.01)
    by_step = Script(tuple(commands))
    for step in range(60):
        for command in by_step.due(step):
            singles = {dgu: one.after(command, step) for dgu, one in singles.items()}
            grid = grid.after(command, step)
        rows = np.array([drawn, drawn])
        for position, one in enumerate(singles.values()):
            assert np.asarray(grid.load(step, rows))[:, position].tolist() == [one.load(step, drawn[position])] * 2
            assert np.asarray(grid.reference(rows))[:, position].tolist() == [one.reference(drawn[position])] * 2


def test_a_load_follows_its_commands(six: Scenario) -> None:
    """Set, then more, then a ramp from 0 at its step; the reference from its step on; other DGUs feel nothing of it."""
    script = """script=[
      {step: 10, command: load_set, dgu: 2, current_a: 4.0}, {step: 20, command: load_step, dgu: 2, current_a: 1.0},
      {step: 30, command: load_ramp, dgu: 2, current_a: 2.0, ramp_sec: 0.04},
      {step: 40, command: reference_set, dgu: 1, voltage_v: 40.0},
      {step: 50, command: load_set, dgu: 2, current_a: 0}]"""
    scenario = parse_scenario(six.to_yaml(), overrides=["duration_sec=0.6", script])
    plain = parse_scenario(six.to_yaml(), overrides=["duration_sec=0.6"])
    (block,), (quiet,) = simulate(scenario), simulate(plain)
    load = block.load_current[:, 0, 1]
    assert load[10:20].tolist() == [4.0] * 10
    assert load[20:31].tolist() == [5.0] * 11
    np.testing.assert_allclose(load[31:36], [5.5, 6.0, 6.5, 7.0, 7.0], rtol=1e-15)
    assert load[50:].tolist() == [0.0] * 10
    np.testing.assert_array_equal(block.load_current[:, 0, 2:], quiet.load_current[:, 0, 2:])
    np.testing.assert_array_equal(block.x[:11], quiet.x[:11])
    reference = (block.reference - block.alpha)[:, 0, 0]
    np.testing.assert_allclose(reference[40:], 40.0, rtol=1e-15)
    assert [one.number for one in block.commands] == [1, 2, 3, 4, 5]
