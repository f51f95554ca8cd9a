"""Wrong scenarios end in one line: file, key, value and what was expected."""

from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from bags.watch.scenarios import load_scenario, parse_scenario
from dgu_sim.errors import ScenarioError
from dgu_sim.scenario import Scenario

WRONG_VALUES = [
    ("secondary.gain=0.5", "secondary.gain = 0.5: expected a gain that is stable when sampled every 0.01 s"),
    ("secondary.gain=-1", "secondary.gain = -1: expected a number greater than 0"),
    ("secondary.gian=1", "secondary.gian = 1: no such key: did you mean gain? known keys are enabled, gain"),
    ("dgus.0.k1=2", "dgus.0.k1 = 2.0: expected k1 < 1 (gain condition)"),
    ("dgus.0.k2=0.3", "dgus.0.k2 = 0.3: expected k2 < resistance_ohm = 0.2 (gain condition)"),
    ("dgus.0.k3=700", "dgus.0.k3 = 700.0: expected 0 < k3 < (k1 - 1)(k2 - R_t)/L_t = 632.023 (gain condition)"),
    ("dgus.0.resistance_ohm=-0.2", "dgus.0.resistance_ohm = -0.2: expected a number greater than 0"),
    ("dgus.1.id=1", "dgus.1.id = 1: expected an id that no other DGU has"),
    ("dgus.5.id=1.5", "dgus.5.id = 1.5: expected a valid integer"),
    ("dgus.2.initial_state=[1, 2]", "dgus.2.initial_state = [1, 2]: expected equilibrium or 3 numbers"),
    ("dgus.0.load=[{kind: unform}]", "dgus.0.load.0.kind = 'unform': expected one of 'constant', 'step'"),
    ("dgus.0.load=[{kind: uniform, low_a: 3, high_a: 1}]", "dgus.0.load.0.high_a = 1.0: expected at least low_a = 3"),
    ("dgus.0.load=[{kind: step, current_a: 1}]", "dgus.0.load.0.at_sec: this key is missing"),
    ("dgus.0.load=5", "dgus.0.load = 5: expected a list"),
    (
        "lines.0.between=[1, 9]",
        "lines.0.between = [1, 9]: expected two of the DGUs 1, 2, 3, 4, 5, 6: there is no DGU 9",
    ),
    ("lines.1.between=[2, 1]", "lines.1.between = [2, 1]: expected one line between two DGUs: this one is a second"),
    ("lines.0.between=[2, 2]", "lines.0.between = [2, 2]: expected two different DGUs"),
    ("lines.0.between=[1]", "lines.0.between = [1]: expected two DGU numbers"),
    ("lines.0.inductance_h=0.01", "lines.0.inductance_h = 0.01: expected at most 5e-05: lines are quasi-stationary"),
    ("noise={kind: gaussian, std: [1, 2]}", "noise.std = [1, 2]: expected 3 numbers: V [V], I_t [A], v [V s]"),
    ("noise={kind: gaussian, std: [1, -2, 0]}", "noise.std.1 = -2: expected a number greater than or equal to 0"),
    ("coupling=helt", "coupling = 'helt': expected 'isolated', 'held' or 'joint'"),
    ("history.precision=float16", "history.precision = 'float16': expected 'float32' or 'float64'"),
    ("duration_sec=yes", "duration_sec = True: expected a number"),
    ("seed=-1", "seed = -1: expected a number greater than or equal to 0"),
    ("attacks.0.link=1-5", "attacks.0.link = '1-5': expected a communication link: 1-2, 1-3"),
    ("attacks.0.link=east", "attacks.0.link = 'east': expected SOURCE-TARGET, like 1-2"),
    ("attacks.0.bias=[1, 2]", "attacks.0.bias = [1, 2]: expected 3 numbers: V [V], I_t [A], v [V s]"),
    ("attacks.0.bais=[1, 2, 3]", "attacks.0.bais = [1, 2, 3]: no such key: did you mean bias?"),
    ("attacks.0.kind=bais", "attacks.0.kind = 'bais': expected an attack class, one of bias"),
    ("attacks.0.start_sec=2.4", "attacks.0.start_sec = 2.4: expected at least 2.5: until then the detectors calibrate"),
    ("attacks.0.stop_sec=5", "attacks.0.stop_sec = 5.0: expected a time after start_sec = 5"),
    (
        "monitor.plausibility={limits: {range: [1.0, -0.1]}}",
        "monitor.plausibility.limits.range = [1.0, -0.1]: expected two numbers that are not negative",
    ),
    ("monitor.response={quiet: 3}", "monitor.response.quiet = 3: no such key: did you mean quiet_sec?"),
    ("secondary=5", "secondary = 5: expected a mapping of keys to values"),
    ("dgus=[]", "dgus = []: expected at least 1 entries"),
]


def _line(error: ScenarioError) -> str:
    assert "\n" not in str(error)
    return str(error)


@pytest.mark.parametrize(("override", "said"), WRONG_VALUES)
def test_override_is_blamed_for_what_it_sets(shipped: Callable[..., Scenario], override: str, said: str) -> None:
    """The line names the override, the key, the value and what was expected."""
    with pytest.raises(ScenarioError) as caught:
        shipped("gallo_six_dgu", override)
    assert _line(caught.value).startswith(f"override {override!r}: {said}")


@pytest.mark.parametrize(("override", "said"), WRONG_VALUES)
def test_file_is_blamed_for_what_it_says(
    shipped: Callable[..., Scenario], tmp_path: Path, override: str, said: str
) -> None:
    """The same mistake written into a file gives the same line with the file's name."""
    data = yaml.safe_load(shipped("gallo_six_dgu").to_yaml())
    path, _, value = override.partition("=")
    node = data
    *parents, last = path.split(".")
    for key in parents:
        node = node[int(key)] if isinstance(node, list) else node[key]
    node[int(last) if isinstance(node, list) else last] = yaml.safe_load(value)
    file = tmp_path / "wrong.yaml"
    file.write_text(yaml.safe_dump(data), encoding="utf-8")
    with pytest.raises(ScenarioError) as caught:
        load_scenario(file)
    assert _line(caught.value).startswith(f"{file}: {said}")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("name: [1", "t.yaml, line 2, column 1: expected YAML"),
        ("name: a\nname: b", "t.yaml, line 2, column 1: expected YAML: key 'name' stands twice"),
        ("- 1", "t.yaml: expected a mapping of scenario keys, found [1]"),
        ("", "t.yaml: expected a mapping of scenario keys, found None"),
        ("name: x", "t.yaml: dgus: this key is missing"),
        ("name: x\ndgus: [{id: 1}]", "t.yaml: dgus.0.resistance_ohm: this key is missing"),
        ("nam: x", "t.yaml: nam = 'x': no such key: did you mean name? known keys are name, description, seed"),
    ],
)
def test_wrong_text(text: str, said: str) -> None:
    """What is no YAML gets its line and column, what is no scenario its key."""
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(text, "t.yaml")
    assert _line(caught.value).startswith(said)


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("gain", "override 'gain': expected KEY=VALUE"),
        ("=3", "override '=3': expected KEY=VALUE"),
        ("seed=[", "override 'seed=[': expected a YAML value"),
        ("dgus.9.k1=0", "override 'dgus.9.k1=0': dgus has entries 0 ... 5, found '9'"),
        ("dgus.first.k1=0", "override 'dgus.first.k1=0': dgus has entries 0 ... 5, found 'first'"),
        ("secondary.gain.x=1", "override 'secondary.gain.x=1': secondary.gain = 0.1 has no keys below it"),
    ],
)
def test_override_that_leads_nowhere(shipped: Callable[..., Scenario], override: str, said: str) -> None:
    """An override is checked on its own first."""
    with pytest.raises(ScenarioError) as caught:
        shipped("gallo_six_dgu", override)
    assert _line(caught.value).startswith(said)


def test_unstable_gain_names_radius_and_limit(shipped: Callable[..., Scenario]) -> None:
    """The spectral radius and the largest stable gain, found by bisection, are in the line."""
    with pytest.raises(ScenarioError, match=r"below 0\.2107; spectral radius is 1\.0116"):
        shipped("gallo_six_dgu", "secondary.gain=0.5")


def test_gain_that_a_new_sampling_period_breaks(shipped: Callable[..., Scenario]) -> None:
    """The check is about gain and sampling period together: the file's gain is named when the period changes."""
    with pytest.raises(ScenarioError, match=r"gallo_six_dgu\.yaml: secondary\.gain = 0\.1: expected .* every 0\.1 s"):
        shipped("gallo_six_dgu", "sampling_period_sec=0.1")


def test_secondary_control_needs_a_coupled_grid(shipped: Callable[..., Scenario]) -> None:
    """Isolated DGUs cannot share current: alpha would run away."""
    with pytest.raises(ScenarioError, match=r"secondary\.enabled = True: expected false: with coupling isolated"):
        shipped("gallo_six_dgu", "coupling=isolated")


def test_joint_history_needs_a_coupled_grid(shipped: Callable[..., Scenario]) -> None:
    """There is no joint grid to record when DGUs are isolated."""
    with pytest.raises(ScenarioError, match=r"history\.plant = 'joint': expected own"):
        shipped("isolated_dgu_1", "history.plant=joint")


def test_missing_file() -> None:
    """A path that leads nowhere is named."""
    with pytest.raises(ScenarioError, match=r"nowhere\.yaml: expected a readable scenario file: No such file"):
        load_scenario(Path("nowhere.yaml"))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "expected a readable CSV file"),
        ("t,i\n0,1\n", "expected the columns time_sec, current_a in the header"),
        ("time_sec,time_sec,current_a\n0,0,1\n", "expected one column time_sec, found 2"),
        ("time_sec,current_a\n0,1\n1,x\n", "line 3: current_a: expected a number, found 'x'"),
        ("time_sec,current_a\n0,1\n1\n", "line 3: current_a: expected a number, found ''"),
        ("time_sec,current_a\n0,1\n1,nan\n", "current_a.1 = nan: expected a finite number"),
        ("time_sec,current_a\n0,1\n0,2\n", "time_sec.1 = 0.0: expected a time after 0"),
        ("time_sec,current_a\n", "time_sec = []: expected at least 1 entries"),
    ],
)
def test_wrong_table(shipped: Callable[..., Scenario], tmp_path: Path, content: str | None, said: str) -> None:
    """A missing, misshapen or unordered table is named with its place."""
    if content is not None:
        (tmp_path / "load.csv").write_text(content, encoding="utf-8")
    path = tmp_path / "mine.yaml"
    path.write_text(shipped("gallo_six_dgu").to_yaml(), encoding="utf-8")
    with pytest.raises(ScenarioError) as caught:
        load_scenario(path, ["dgus.1.load=[{kind: table, file: load.csv}]"])
    assert "dgus.1.load.0" in _line(caught.value)
    assert said in str(caught.value)
