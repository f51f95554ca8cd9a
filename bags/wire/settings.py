"""What the monitors of a run are told: the section `monitor` of its scenario, as `monitor` checks it."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from pydantic import ValidationError

from dgu_sim.errors import ScenarioError
from dgu_sim.explain import explain
from dgu_sim.scenario_file import apply_overrides, parse_yaml, raised_by
from monitor.settings import MonitorSettings

if TYPE_CHECKING:
    from dgu_sim.scenario import Scenario


def settings_of(scenario: "Scenario", source: str = "scenario", overrides: Sequence[str] = ()) -> MonitorSettings:
    """What the monitors of a scenario are told.

    Args:
        scenario: The scenario.
        source: What to call it in messages.
        overrides: What was changed in it, "a.b=value" each.

    Raises:
        ScenarioError: One line with source, key, value and what was expected.
    """
    return _checked(scenario.monitor, source, overrides)


def parse_monitor(text: str, source: str, overrides: Sequence[str] = ()) -> MonitorSettings:
    """What monitors are told by the section alone, given as YAML text.

    Args:
        text: The YAML text.
        source: What to call it in messages.
        overrides: "monitor.a.b=value" each.

    Raises:
        ScenarioError: One line with source, key, value and what was expected.
    """
    data = {"monitor": parse_yaml(text, source)}
    apply_overrides(data, overrides, source)
    return _checked(data["monitor"], source, overrides)


def _checked(section: Mapping[str, object], source: str, overrides: Sequence[str]) -> MonitorSettings:
    try:
        return MonitorSettings.model_validate(section)
    except ValidationError as error:
        problem = explain(error, section)
        raise ScenarioError(f"{raised_by(('monitor', *problem.key), overrides, source)}: monitor.{problem}") from error
