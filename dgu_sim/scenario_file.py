"""From the text of a scenario file to plain data: YAML, overrides, CSV tables."""

import csv
from collections.abc import Hashable, Sequence
from pathlib import Path
from typing import Any

import yaml

from dgu_sim.errors import ScenarioError
from dgu_sim.explain import shown
from dgu_sim.yaml_limits import check_limits

__all__ = ["apply_overrides", "embed_tables", "parse_yaml", "raised_by", "resolve_history_bag"]

COLUMNS = ("time_sec", "current_a")


class _UniqueKeyLoader(yaml.SafeLoader):
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


def parse_yaml(text: str, source: str) -> dict[str, Any]:
    """Return the mapping that a scenario text holds.

    Raises:
        ScenarioError: It is no YAML (with the line) or no mapping.
    """
    try:
        check_limits(text)
        data = yaml.load(text, Loader=_UniqueKeyLoader)  # noqa: S506 - derived from SafeLoader
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
        if path == name or path.startswith(name + "."):
            return f"override {override!r}"
    return source


def embed_tables(data: dict[str, Any], source: str, directory: Path | None) -> None:
    """Replace `file: table.csv` of table loads by the values, in place: a resolved scenario needs no other file.

    Raises:
        ScenarioError: A file cannot be read or is not a table of time_sec and current_a.
    """
    dgus = data.get("dgus")
    for index, dgu in enumerate(dgus if isinstance(dgus, list) else []):
        loads = dgu.get("load") if isinstance(dgu, dict) else None
        for item, load in enumerate(loads if isinstance(loads, list) else []):
            if isinstance(load, dict) and load.get("kind") == "table" and "file" in load:
                where = f"{source}: dgus.{index}.load.{item}.file = {shown(load['file'])}"
                table = _read_table(where, load.pop("file"), directory)
                for column, values in zip(COLUMNS, table, strict=True):
                    if column in load:
                        raise ScenarioError(f"{where}: expected either a file or {column}, found both")
                    load[column] = values


def resolve_history_bag(data: dict[str, Any], directory: Path | None) -> None:
    """Make a relative `history.bag` absolute, in place: it stands beside the scenario file."""
    history = data.get("history")
    bag = history.get("bag") if isinstance(history, dict) else None
    if directory is not None and isinstance(bag, str):
        data["history"]["bag"] = str((directory / bag).resolve())


def _read_table(where: str, file: object, directory: Path | None) -> tuple[list[float], list[float]]:
    if directory is None or not isinstance(file, str):
        raise ScenarioError(f"{where}: expected the name of a CSV file beside the scenario file")
    try:
        with (directory / file).open(newline="", encoding="utf-8") as stream:
            rows = list(csv.reader(stream))
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{where}: expected a readable CSV file in {directory}") from error
    header = tuple(name.strip() for name in rows[0]) if rows else ()
    if header != COLUMNS:
        raise ScenarioError(f"{where}: expected the header {','.join(COLUMNS)}, found {shown(','.join(header))}")
    times, currents = [], []
    for number, row in enumerate(rows[1:], start=2):
        try:
            time, current = (float(cell) for cell in row)
        except ValueError as error:
            raise ScenarioError(
                f"{where}: line {number}: expected two numbers, found {shown(','.join(row))}"
            ) from error
        times.append(time)
        currents.append(current)
    return times, currents


def _split(override: str) -> tuple[list[str], object]:
    name, equals, text = override.partition("=")
    keys = name.strip().split(".")
    if not equals or not all(keys):
        raise ScenarioError(f"override {override!r}: expected KEY=VALUE, like secondary.gain=0.05")
    try:
        check_limits(text)
        return keys, yaml.load(text, Loader=_UniqueKeyLoader)  # noqa: S506 - derived from SafeLoader
    except yaml.YAMLError as error:
        raise ScenarioError(f"override {override!r}: expected a YAML value: {_reason(error)}") from error


def _place(error: yaml.YAMLError) -> str:
    mark = getattr(error, "problem_mark", None)
    return "" if mark is None else f", line {mark.line + 1}, column {mark.column + 1}"


def _reason(error: yaml.YAMLError) -> str:
    return str(getattr(error, "problem", None) or error).splitlines()[0]
