"""docs/scenario.md names every key of a scenario, with its default."""

import json
import re
from pathlib import Path

import pytest
from pydantic import BaseModel

from bags.watch.scenarios import parse_scenario
from dgu_sim import excitation, grid_settings, loads, noise, poison, settings
from dgu_sim.attacks import KINDS
from dgu_sim.errors import ScenarioError
from dgu_sim.scenario import Scenario
from monitor import detectors
from monitor import settings as monitor_settings
from monitor.detectors import KINDS as KNOWN_DETECTORS
from monitor.settings import parts, section, team

SECTIONS: dict[str, type[BaseModel]] = {
    "Top level": Scenario,
    "dgus": settings.DguSettings,
    "Load: constant": loads.ConstantLoad,
    "Load: step": loads.StepLoad,
    "Load: ramp": loads.RampLoad,
    "Load: uniform": loads.UniformLoad,
    "Load: gaussian": loads.GaussianLoad,
    "Load: table": loads.TableLoad,
    "lines": settings.LineSettings,
    "Grid: mesh": grid_settings.MeshGrid,
    "Grid: ring": grid_settings.RingGrid,
    "Grid: star": grid_settings.StarGrid,
    "Grid: random_geometric": grid_settings.RandomGeometricGrid,
    "Grid: from_csv": grid_settings.CsvGrid,
    "grid.dgus": grid_settings.DguColumns,
    "grid.lines": grid_settings.LineColumns,
    "grid.dgu": grid_settings.DguTemplate,
    "grid.line": grid_settings.LineTemplate,
    "grid.spread": grid_settings.SpreadSettings,
    "receiver": settings.ReceiverSettings,
    "Poison: scale": poison.ScalePoison,
    "Poison: rotate": poison.RotatePoison,
    "Poison: noise": poison.NoisePoison,
    "Poison: inject": poison.InjectPoison,
    "Poison: hide": poison.HidePoison,
    "secondary": settings.SecondarySettings,
    "Noise: none": noise.NoNoise,
    "Noise: uniform": noise.UniformNoise,
    "Noise: gaussian": noise.GaussianNoise,
    "Noise: student": noise.StudentNoise,
    "history": settings.HistorySettings,
    "Excitation: uniform": excitation.UniformExcitation,
    "Excitation: prbs": excitation.PrbsExcitation,
    "Excitation: multisine": excitation.MultisineExcitation,
    "monitor": monitor_settings.MonitorSettings,
    "monitor.observer": monitor_settings.ObserverSettings,
    "monitor.detector": monitor_settings.DetectorSettings,
    "monitor.team": monitor_settings.TeamSettings,
    "monitor.team.events": monitor_settings.TeamEventSettings,
    "monitor.local": monitor_settings.LocalSettings,
    "monitor.plausibility": monitor_settings.PlausibilitySettings,
    "monitor.plausibility.estimator": monitor_settings.EstimatorSettings,
    "monitor.plausibility.limits": monitor_settings.LimitSettings,
    "monitor.response": monitor_settings.ResponseSettings,
    "attacks": settings.AttackSettings,
    **{f"Attack: {kind}": attack for kind, attack in KINDS.items()},
}
NO_KEYS = {(settings.AttackSettings, "parameters")}  # gathered from the keys of the attack class


@pytest.fixture(name="page", scope="module")
def _page(root: Path) -> str:
    return (root / "docs" / "scenario.md").read_text(encoding="utf-8")


def _rows(page: str, heading: str) -> dict[str, str]:
    """Return key -> default of the tables of one section."""
    section = re.split(rf"^#+ {re.escape(heading)}$", page, flags=re.MULTILINE)[1]
    section = re.split(r"^#+ ", section, flags=re.MULTILINE)[0]
    return dict(re.findall(r"^\| `(\w+)` \| ([^|]+) \|", section, flags=re.MULTILINE))


def _default(model: type[BaseModel], key: str) -> str:
    field = model.model_fields[key]
    if field.is_required():
        return "required"
    if field.default_factory is not None:
        return "`{}`" if key == "options" and model is not monitor_settings.DetectorSettings else "see below"
    if field.default is None:
        return "none"
    if isinstance(field.default, str):
        return f"`{field.default}`" if field.default else '`""`'
    return f"`{json.dumps(field.default)}`"


@pytest.mark.parametrize("heading", SECTIONS)
def test_every_key_stands_in_its_section_with_its_default(page: str, heading: str) -> None:
    """The page and the models agree on keys and defaults, and every field describes itself."""
    model, rows = SECTIONS[heading], _rows(page, heading)
    for key, field in model.model_fields.items():
        if (model, key) not in NO_KEYS:
            assert rows.get(field.alias or key) == _default(model, key), key
            assert field.description, key


@pytest.mark.parametrize("kind", KNOWN_DETECTORS)
def test_every_option_of_a_detector_stands_there(page: str, kind: str) -> None:
    """Options and their defaults are those that a scenario is filled up with, and those that monitor has."""
    rows = _rows(page, f"Detector: {kind}")
    options: dict[str, object] = {"noise": 0.1} if kind == "noise_bound" else {}
    filled = detectors.filled_in(kind, options)
    inner: dict[str, object] = {"options": {}} if "options" in filled else {}  # what those add has rows of its own
    for option, default in (filled | inner).items():
        if option not in options:
            text = default if isinstance(default, str) else json.dumps(default)
            assert rows.pop(option) == f"`{text}`", option
    assert rows == dict.fromkeys(options, "required")
    assert detectors.build(kind, filled, 0.01) == detectors.build(kind, options, 0.01)


def test_inner_options_are_filled_in_and_counted() -> None:
    """N of M shows its inner detector's options; attacks wait for that one's calibration."""
    given = {"kind": "n_of_m", "options": {"kind": "calibrated", "options": {"rate": 0.1}}}
    detector = monitor_settings.DetectorSettings.model_validate(given)
    inner = detectors.filled_in("calibrated", {"rate": 0.1})
    assert detector.options == {"n": 3, "m": 5, "kind": "calibrated", "options": inner}
    assert detector.calibrated_sec == 10.5


def test_every_model_of_a_scenario_has_a_section() -> None:
    """A new load, noise or section cannot be forgotten."""
    found = {
        value
        for module in (excitation, grid_settings, loads, noise, parts, section, settings, poison, team)
        for value in vars(module).values()
        if isinstance(value, type) and issubclass(value, BaseModel) and value.__module__ == module.__name__
        if not value.__name__.startswith("_")
    }
    assert found <= set(SECTIONS.values())


def test_example_and_its_error_are_real(page: str) -> None:
    """The example on the page loads, and the error shown is the one it gives."""
    example = page.split("```yaml\n")[1].split("```", maxsplit=1)[0]
    parse_scenario(example)
    wrong = example.replace("lines:", "secondary: {gain: 5}\nlines:")
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(wrong, "two_dgus.yaml")
    assert str(caught.value) in page


def test_shipped_scenarios_are_listed(page: str, scenario_files: list[Path]) -> None:
    """The page names every shipped scenario."""
    for path in scenario_files:
        assert f"`{path.stem}`" in page
