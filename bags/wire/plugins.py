"""Which plug-in of which version made a bag, and whether it is here (docs/plugins.md)."""

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from bags.mcap.errors import BagError
from bags.mcap.yaml_text import load
from dgu_sim import plugins as of_grid
from dgu_sim.attacks.falsifications import GROUP as ATTACKS
from monitor import plugins as of_monitors
from monitor.detectors.registry import GROUP as DETECTORS
from monitor.observers.registry import GROUP as OBSERVERS

__all__ = ["ATTACKS", "DETECTORS", "KEY", "OBSERVERS", "check_plug_ins", "installed", "used_plug_ins", "with_plug_ins"]

KEY = "plug_ins"
"""In versions.json: "group/kind" → "package version"."""


def installed(group: str) -> dict[str, str]:
    """The plug-ins of a group that are installed here: kind → "package version"."""
    packages = of_grid.plug_ins if group == ATTACKS else of_monitors.plug_ins
    return {kind: f"{found[0].package} {found[0].version}" for kind, found in packages(group).items()}


def used_plug_ins(scenario: Mapping[str, object], started: Iterable[str] = ()) -> dict[str, str]:
    """The plug-ins that a run is made with: "group/kind" → "package version".

    Args:
        scenario: Of the run, as plain data; of a stream from outside: what its monitors are told, as `monitor`.
        started: Kinds of attacks that were started by hand, or may be.
    """
    here = {group: installed(group) for group in (ATTACKS, DETECTORS, OBSERVERS)}
    used = dict.fromkeys([*_named(scenario), *((ATTACKS, kind) for kind in started)])
    return {f"{group}/{kind}": here[group][kind] for group, kind in used if kind in here[group]}


def with_plug_ins(versions: bytes, used: Mapping[str, str]) -> bytes:
    """A versions.json that names these plug-ins, too; the same bytes where there are none."""
    if not used:
        return versions
    document = _document(versions)
    told = document.get(KEY)
    return json.dumps({**document, KEY: {**(told if isinstance(told, dict) else {}), **used}}, indent=1).encode()


def check_plug_ins(path: Path, scenario: str, versions: bytes, started: Iterable[str] = ()) -> tuple[str, ...]:
    """See that what a bag was made with is here.

    Args:
        path: The bag.
        scenario: Its scenario as YAML, "" when it holds none.
        versions: Its versions.json.
        started: Kinds of attacks that were started by hand and are to be repeated.

    Returns:
        A line for each plug-in that is here in another version.

    Raises:
        BagError: One is not installed: one line that names package and version.
    """
    told = _document(versions).get(KEY)
    if not isinstance(told, dict):
        return ()
    notes = []
    document = load(scenario) if scenario else {}
    used = [*_named(document if isinstance(document, dict) else {}), *((ATTACKS, kind) for kind in started)]
    for group, kind in dict.fromkeys(used):
        made = told.get(f"{group}/{kind}")
        here = installed(group).get(kind)
        if made is None or made == here:
            continue
        what = f"{path}: made with {kind} of {made} (group {group})"
        if here is None:
            package, _, version = str(made).rpartition(" ")
            raise BagError(f"{what}, which is not installed: expected it, as by pip install {package}=={version}")
        notes.append(f"{what}, and here is {here}: the numbers may differ")
    return tuple(notes)


def _named(scenario: Mapping[str, object]) -> Iterator[tuple[str, str]]:
    """Groups and kinds that a scenario names."""
    for kind in _kinds(scenario.get("attacks")):
        yield ATTACKS, kind
    monitor = scenario.get("monitor")
    for part, settings in monitor.items() if isinstance(monitor, dict) else ():
        for kind in _kinds(settings):
            yield OBSERVERS if part == "observer" else DETECTORS, kind


def _kinds(part: object) -> Iterator[str]:
    """Every `kind` in a part of a scenario, at any depth: a detector, and the one inside it."""
    if isinstance(part, dict):
        kind = part.get("kind")
        if isinstance(kind, str):
            yield kind
    for inner in part.values() if isinstance(part, dict) else part if isinstance(part, list) else ():
        yield from _kinds(inner)


def _document(data: bytes) -> dict[str, object]:
    try:
        found = json.loads(data or b"{}")
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}
