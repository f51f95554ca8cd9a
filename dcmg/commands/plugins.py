"""`dcmg plugins`: what installed packages add, and whether it can be used."""

from __future__ import annotations

import json as json_module
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from dcmg.tabular import tabulate
from dgu_sim import attacks
from dgu_sim import plugins as of_grid
from dgu_sim.errors import PlugInError as GridError
from monitor import detectors, observers
from monitor import plugins as of_monitors
from monitor.errors import PlugInError as MonitorError

if TYPE_CHECKING:
    from collections.abc import Iterator

_EXIT_BROKEN = 1


def plugins(*, json: Annotated[bool, typer.Option("--json", help="print a JSON document")] = False) -> None:
    """List what installed packages add: kinds of attacks, detectors and observers (docs/plugins.md).

    Each is imported to see whether it can be used. Exit code 1: some cannot.
    """
    found = list(_found())
    broken = any(one["problem"] for one in found)
    if json:
        typer.echo(json_module.dumps(found))
    elif not found:
        typer.echo("no plug-ins are installed: docs/plugins.md says how to make one")
    else:
        headings = ("group", "kind", "package", "version", "entry point")
        Console().print(tabulate(headings, [tuple(one[name] for name in headings) for one in found]))
        for one in found:
            if one["problem"]:
                typer.echo(one["problem"], err=True)
    raise typer.Exit(_EXIT_BROKEN if broken else 0)


def _found() -> Iterator[dict[str, str]]:
    for kinds in (attacks.KINDS, detectors.KINDS, observers.KINDS):
        packages = of_grid.plug_ins if kinds is attacks.KINDS else of_monitors.plug_ins
        for kind, several in packages(kinds.group).items():
            problem = ""
            try:
                kinds[kind]
            except (GridError, MonitorError) as error:
                problem = str(error)
            for one in several:
                yield {
                    "group": kinds.group,
                    "kind": kind,
                    "package": one.package,
                    "version": one.version,
                    "entry point": one.point.value,
                    "problem": problem,
                }
