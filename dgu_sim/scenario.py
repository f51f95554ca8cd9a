"""A scenario: everything that defines a run, checked and frozen."""

from collections.abc import Sequence
from pathlib import Path
from typing import Self

import yaml
from pydantic import model_validator

from dgu_sim.scenario_checks import check_parts, check_stability
from dgu_sim.scenario_file import (
    apply_overrides,
    embed_tables,
    parse_yaml,
    read_text,
    resolve_history_bag,
    validated,
)
from dgu_sim.sections import Sections

__all__ = ["Scenario", "load_scenario", "parse_scenario"]


class Scenario(Sections):
    """Everything that defines a run: sections that fit together."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        check_parts(self)
        check_stability(self, self.grid)
        return self

    def to_yaml(self) -> str:
        """Return the fully resolved scenario, defaults and tables included; `parse_scenario` reads it back."""
        return str(yaml.safe_dump(self.model_dump(mode="json"), sort_keys=False, allow_unicode=True, width=100))


def load_scenario(path: Path | str, overrides: Sequence[str] = ()) -> Scenario:
    """Read and check a scenario file.

    Args:
        path: The YAML file.
        overrides: "a.b=value" each; list indices count from 0, values are YAML.

    Raises:
        ScenarioError: One line with file, key, value and what was expected.
    """
    path = Path(path)
    text = read_text(path, "scenario file")
    return parse_scenario(text, source=str(path), overrides=overrides, directory=path.parent)


def parse_scenario(
    text: str, source: str = "scenario", overrides: Sequence[str] = (), directory: Path | None = None
) -> Scenario:
    """Check a scenario given as YAML text.

    Args:
        text: The YAML text.
        source: What to call it in messages.
        overrides: As for `load_scenario`.
        directory: Where CSV tables are looked for; None: the text must not name any.

    Raises:
        ScenarioError: One line with source, key, value and what was expected.
    """
    data = parse_yaml(text, source)
    apply_overrides(data, overrides, source)
    embed_tables(data, source, directory, overrides)
    resolve_history_bag(data, directory)
    return validated(Scenario, data, source, overrides)
