"""A page of its own for each module of tests, as a person starts it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from bags.watch.scenarios import load_scenario
from dcmg.shipped import scenario_path
from tests.dcmg.page.serving import serving_page

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager

    from dgu_sim.scenario import Scenario


@pytest.fixture(scope="session")
def serving() -> Callable[..., AbstractContextManager[str]]:
    """Run `dcmg page WORDS`; the address is what it says first."""
    return serving_page


@pytest.fixture(scope="session")
def shipped() -> Callable[..., Scenario]:
    """Load a shipped scenario with changes."""
    return lambda name, *changes: load_scenario(scenario_path(name), changes)
