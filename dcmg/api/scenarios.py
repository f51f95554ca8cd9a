"""Scenarios by name or file."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from bags.watch import scenarios
from dcmg.shipped import scenario_path

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dgu_sim.scenario import Scenario


def load_scenario(name: str | os.PathLike[str], overrides: Sequence[str] = ()) -> Scenario:
    """Read and check a scenario.

    Args:
        name: of a shipped scenario (`dcmg scenarios` lists them), or path of a YAML file (docs/scenario.md).
        overrides: changes, as in "duration_sec=20" or "dgus.0.load={kind: constant, current_a: 12}".

    Raises:
        ScenarioError: there is none, or it is not valid: one line with file, key, value and what was expected.
    """
    changes = [overrides] if isinstance(overrides, str) else list(overrides)
    return scenarios.load_scenario(scenario_path(os.fspath(name)), changes)
