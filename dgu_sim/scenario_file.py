"""From the text of a scenario file to plain data: YAML, overrides, CSV tables."""

from collections.abc import Hashable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from dgu_sim.errors import ScenarioError
from dgu_sim.explain import explain, shown
from dgu_sim.grid_settings import DguColumns, LineColumns
from dgu_sim.table_file import ATTACK_COLUMNS, LOAD_COLUMNS, TableFileError, embed_table
from dgu_sim.yaml_limits import SafeLoader, load_within_limits

__all__ = [
    "WAVEFORM",
    "apply_overrides",
    "embed_tables",
    "embed_waveforms",
    "parse_yaml",
    "raised_by",
    "read_text",
    "resolve_history_bag",
    "validated",
]

Model = TypeVar("Model", bound=BaseModel)

WAVEFORM = "bias_waveform"
"""The kind of attack that may name a file."""


DGU_COLUMNS, LINE_COLUMNS = tuple(DguColumns.model_fields), tuple(LineColumns.model_fields)


class _UniqueKeyLoader(SafeLoader):
    """YAML keeps the last of two equal keys in silence; a scenario must not."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:  # noqa: FBT001, FBT002 - PyYAML's signature
        seen = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if isinstance(key, Hashable) and key in seen:
                raise yaml.constructor.ConstructorError(None, None, f"key {key!r} stands twice", key_node.start_mark)
            if isinstance(key, Hashable):
                seen.add(key)
        return super().construct_mapping(node, deep)


def read_text(path: Path, what: str) -> str:
    """Return the text of a file, "scenario file" in messages.

    Raises:
        ScenarioError: It cannot be read, or is a pipe or the like, which would be waited for.
    """
    try:
        if not (path.is_file() or path.is_dir()) and path.exists():
            raise ScenarioError(f"{path}: is no regular file, expected a {what}")
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        raise ScenarioError(f"{path}: expected a readable {what}: {reason}") from error


def validated(model: type[Model], data: Mapping[str, Any], source: str, overrides: Sequence[str] = ()) -> Model:
    """Return plain data as what they are to be.

    Raises:
        ScenarioError: One line with source or override, key, value and what was expected.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        problem = explain(error, data)
        raise ScenarioError(f"{raised_by(problem.key, overrides, source)}: {problem}") from error


def parse_yaml(text: str, source: str) -> dict[str, Any]:
    """Return the mapping that a scenario text holds.

    Raises:
        ScenarioError: It is no YAML (with the line) or no mapping.
    """
    try:
        data = load_within_limits(text, _UniqueKeyLoader)
    except yaml.YAMLError as error:
        raise ScenarioError(f"{source}{_place(error)}: expected YAML: {_reason(error)}") from error
    if not isinstance(data, dict):
        raise ScenarioError(f"{source}: expected a mapping of scenario keys, found {shown(data)}")
    return data


def apply_overrides(data: dict[str, Any], overrides: Sequence[str], source: str) -> None:
    """Set each "a.b=value" in place; sections that the file leaves out are made.

    Raises:
        ScenarioError: An override is not KEY=VALUE, its value is no YAML, or its path leads nowhere.
    """
    for override in overrides:
        keys, value = _split(override)
        node: Any = data
        for depth, key in enumerate(keys):
            last = depth == len(keys) - 1
            where = f"override {override!r}"
            if isinstance(node, list):
                if not (key.isdecimal() and int(key) < len(node)):
                    path = ".".join(keys[:depth])
                    raise ScenarioError(f"{where}: {path} has entries 0 ... {len(node) - 1}, found {key!r} ({source})")
                if last:
                    node[int(key)] = value
                else:
                    node = node[int(key)]
            elif isinstance(node, dict):
                if last:
                    node[key] = value
                else:
                    node = node.setdefault(key, {})
            else:
                path = ".".join(keys[:depth])
                raise ScenarioError(f"{where}: {path} = {shown(node)} has no keys below it ({source})")


def raised_by(key: tuple[str | int, ...], overrides: Sequence[str], source: str) -> str:
    """Return what to blame for a wrong key: the override that set it, or the file."""
    path = ".".join(str(part) for part in key)
    for override in reversed(overrides):
        name = override.partition("=")[0].strip()
        if path == name or path.startswith(name + ".") or (path and name.startswith(path + ".")):
            return f"override {override!r}"
    return source


def embed_tables(data: dict[str, Any], source: str, directory: Path | None, overrides: Sequence[str] = ()) -> None:
    """Replace `file: table.csv` of loads, attacks and a grid by the values, in place: it needs no other file then.

    Raises:
        ScenarioError: A file cannot be read or lacks a column.
    """
    grid = data["grid"] if isinstance(data.get("grid"), dict) else {}
    dgus: list[tuple[tuple[str | int, ...], object]] = [(("grid", "dgu"), grid.get("dgu"))]
    dgus += [(("dgus", index), dgu) for index, dgu in enumerate(_entries(data.get("dgus")))]
    for place, dgu in dgus:
        for item, load in enumerate(_entries(dgu.get("load")) if isinstance(dgu, dict) else ()):
            if load.get("kind") == "table":
                key = (*place, "load", item)
                where = f"{raised_by(key, overrides, source)}: {'.'.join(map(str, key))}"
                _embed(load, LOAD_COLUMNS, directory, where)
    for name, known, needed in (("dgus", DGU_COLUMNS, None), ("lines", LINE_COLUMNS, LINE_COLUMNS[0])):
        if isinstance(grid.get(name), dict):
            where = f"{raised_by(('grid', name), overrides, source)}: grid.{name}"
            _embed(grid[name], known, directory, where, needed)
    embed_waveforms(data, source, directory, overrides)


def embed_waveforms(data: dict[str, Any], source: str, directory: Path | None, overrides: Sequence[str] = ()) -> None:
    """Do so for the attacks, what a second publisher falsifies included.

    Raises:
        ScenarioError: A file cannot be read or lacks a column.
    """
    for index, attack in enumerate(_entries(data.get("attacks"))):
        blamed = raised_by(("attacks", index), overrides, source)
        for key, one in ((f"attacks.{index}", attack), (f"attacks.{index}.falsify", attack.get("falsify"))):
            if isinstance(one, dict) and one.get("kind") == WAVEFORM:
                _embed(one, ATTACK_COLUMNS, directory, f"{blamed}: {key}")


def _entries(section: object) -> list[dict[str, Any]]:
    """Entries of a list that may be anything yet; what is none stands for itself as an empty one."""
    return [one if isinstance(one, dict) else {} for one in section] if isinstance(section, list) else []


def _embed(
    entry: dict[str, Any],
    known: Sequence[str],
    directory: Path | None,
    where: str,
    needed: str | None = LOAD_COLUMNS[0],
) -> None:
    try:
        embed_table(entry, known, directory, needed)
    except TableFileError as error:
        raise ScenarioError(f"{where}.{error}") from error


def resolve_history_bag(data: dict[str, Any], directory: Path | None) -> None:
    """Make a relative `history.bag` absolute, in place: it stands beside the scenario file."""
    history = data.get("history")
    bag = history.get("bag") if isinstance(history, dict) else None
    if directory is not None and isinstance(bag, str):
        data["history"]["bag"] = str((directory / bag).resolve())


def _split(override: str) -> tuple[list[str], object]:
    name, equals, text = override.partition("=")
    keys = name.strip().split(".")
    if not equals or not all(keys):
        raise ScenarioError(f"override {override!r}: expected KEY=VALUE, like secondary.gain=0.05")
    try:
        return keys, load_within_limits(text, _UniqueKeyLoader)
    except yaml.YAMLError as error:
        raise ScenarioError(f"override {override!r}: expected a YAML value: {_reason(error)}") from error


def _place(error: yaml.YAMLError) -> str:
    mark = getattr(error, "problem_mark", None)
    return "" if mark is None else f", line {mark.line + 1}, column {mark.column + 1}"


def _reason(error: yaml.YAMLError) -> str:
    return str(getattr(error, "problem", None) or error).splitlines()[0]
