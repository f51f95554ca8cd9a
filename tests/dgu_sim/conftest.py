"""Fixtures shared by the tests of dgu_sim."""

from collections.abc import Callable
from pathlib import Path

import pytest

from bags.watch.scenarios import load_scenario
from dgu_sim.scenario import Scenario

ROOT = Path(__file__).resolve().parents[2]
SCENARIOS = ROOT / "dcmg" / "scenarios"


@pytest.fixture(scope="session")
def root() -> Path:
    """Top of the tree."""
    return ROOT


@pytest.fixture(scope="session")
def scenario_files() -> list[Path]:
    """Every shipped scenario."""
    return sorted(SCENARIOS.glob("*.yaml"))


@pytest.fixture(scope="session")
def shipped() -> Callable[..., Scenario]:
    """Load a shipped scenario by name, with overrides."""

    def load(name: str, *overrides: str) -> Scenario:
        return load_scenario(SCENARIOS / f"{name}.yaml", overrides)

    return load
