"""Scenarios by name or path."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from dcmg.suggest import did_you_mean
from dgu_sim.errors import ScenarioError

_SUFFIXES = (".yaml", ".yml")


def shipped_scenarios() -> dict[str, Path]:
    """Return the scenarios that come with the package: name → file."""
    folder = Path(str(resources.files("dcmg") / "scenarios"))
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}


def scenario_path(name_or_path: str) -> Path:
    """Return the file of a shipped scenario's name, or the path itself.

    Raises:
        ScenarioError: neither a shipped name nor an existing file.
    """
    path = Path(name_or_path)
    if path.is_file():
        return path
    shipped = shipped_scenarios()
    if name_or_path in shipped:
        return shipped[name_or_path]
    if path.suffix in _SUFFIXES or len(path.parts) > 1:
        raise ScenarioError(f"{name_or_path}: no such file")
    raise ScenarioError(f"{name_or_path}: no such scenario; {did_you_mean(name_or_path, shipped)}, or a path to a file")
