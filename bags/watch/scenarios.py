"""A scenario and what its monitors are told, checked together."""

from collections.abc import Sequence
from pathlib import Path

from pydantic_core import PydanticCustomError

from bags.watch.orders import check_script
from bags.watch.team_checks import check_team
from bags.wire.settings import settings_of
from dgu_sim import plausible
from dgu_sim import scenario as scenarios
from dgu_sim.errors import ScenarioError
from dgu_sim.explain import Problem, shown
from dgu_sim.model import finding
from dgu_sim.plausible import Concern
from dgu_sim.scenario import Scenario
from dgu_sim.scenario_file import raised_by
from monitor.settings import MonitorSettings

MOST_NEIGHBOURS = 64
"""Bits of the masks in a Verdict message."""


def load_scenario(path: Path | str, overrides: Sequence[str] = ()) -> Scenario:
    """Read and check a scenario file, what its monitors are told included.

    Args:
        path: The YAML file.
        overrides: "a.b=value" each; list indices count from 0, values are YAML.

    Raises:
        ScenarioError: One line with file, key, value and what was expected.
    """
    return check_scenario(scenarios.load_scenario(path, overrides), str(path), overrides)


def parse_scenario(
    text: str, source: str = "scenario", overrides: Sequence[str] = (), directory: Path | None = None
) -> Scenario:
    """Check a scenario given as YAML text, what its monitors are told included.

    Args:
        text: The YAML text.
        source: What to call it in messages.
        overrides: As for `load_scenario`.
        directory: Where CSV tables are looked for; None: the text must not name any.

    Raises:
        ScenarioError: One line with source, key, value and what was expected.
    """
    return check_scenario(scenarios.parse_scenario(text, source, overrides, directory), source, overrides)


def check_scenario(scenario: Scenario, source: str, overrides: Sequence[str] = ()) -> Scenario:
    """Return the scenario with all that its monitors are told, defaults included, seen to fit the rest.

    Raises:
        ScenarioError: It does not.
    """
    settings = settings_of(scenario, source, overrides)
    try:
        _check_attacks(scenario, settings)
        check_script(scenario, settings)
        check_team(scenario, settings.team)
        _check_combined(scenario, settings)
    except PydanticCustomError as error:
        found = error.context or {}
        problem = Problem(key=found["key"], found=shown(found["value"]), expected=found["expected"])
        raise ScenarioError(f"{raised_by(problem.key, overrides, source)}: {problem}") from None
    return scenario.model_copy(update={"monitor": settings.model_dump(mode="json")})


def concerns(scenario: Scenario) -> tuple[Concern, ...]:
    """Look for what is valid and hardly meant, of the plant and of its monitors.

    Args:
        scenario: What `load_scenario` returned.
    """
    ready, ends = settings_of(scenario).calibrated_sec, scenario.steps * scenario.sampling_period_sec
    unwatched = (
        Concern(
            text=f"duration_sec = {scenario.duration_sec:g}: the detectors learn until {ready:g} s: nothing is watched",
            key=("duration_sec",),
        ),
    )
    return (*plausible.concerns(scenario), *(unwatched if ends <= ready else ()))


def _check_attacks(scenario: Scenario, settings: MonitorSettings) -> None:
    for index, attack in enumerate(scenario.attacks):
        if attack.start_sec < settings.calibrated_sec:
            ready = f"expected at least {settings.calibrated_sec:g}"
            expected = f"{ready}: until then the detectors calibrate on attack-free samples"
            raise finding(("attacks", index, "start_sec"), attack.start_sec, expected)


def _check_combined(scenario: Scenario, settings: MonitorSettings) -> None:
    """Check what monitors that draw one conclusion from several tests need."""
    if settings.response is not None and not scenario.secondary.enabled:
        expected = "expected none: secondary control is off, there is nothing to leave a link out of"
        raise finding(("monitor", "response"), settings.response.model_dump(), expected)
    grid = scenario.grid
    for dgu in grid.dgus if settings.combined else ():
        if len(grid.neighbours(dgu)) > MOST_NEIGHBOURS:
            expected = f"expected none: a verdict has bits for {MOST_NEIGHBOURS} neighbours"
            raise finding(("monitor",), f"local, plausibility or response at DGU {dgu}", expected)
