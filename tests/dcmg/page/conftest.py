"""A page of its own for each module of tests, as a person starts it."""

from __future__ import annotations

import subprocess
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

from bags.watch.scenarios import load_scenario
from dcmg.shipped import scenario_path

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from contextlib import AbstractContextManager

    from dgu_sim.scenario import Scenario


@contextmanager
def _serving(*words: str) -> Iterator[str]:
    command = [sys.executable, "-m", "dcmg", "page", *words, "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.terminate()


@pytest.fixture(scope="session")
def serving() -> Callable[..., AbstractContextManager[str]]:
    """Run `dcmg page WORDS`; the address is what it says first."""
    return _serving


@pytest.fixture(scope="session")
def shipped() -> Callable[..., Scenario]:
    """Load a shipped scenario with changes."""
    return lambda name, *changes: load_scenario(scenario_path(name), changes)
