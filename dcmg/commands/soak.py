"""`dcmg measure soak`: does a long run stay within bounded memory, and is its bag worth something?"""

from __future__ import annotations

import json as json_module
import tempfile
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from dcmg.measures.soak import SoakReport
from dcmg.measures.soak import soak as run_soak
from dcmg.tabular import tabulate

_EXIT_FAILED = 1


def soak(
    scenario: Annotated[str, typer.Argument(help="name of a shipped scenario or path of a file")] = "gallo_six_dgu",
    *,
    duration: Annotated[float, typer.Option(metavar="SECONDS", help="simulated length of the run [s]")] = 3600.0,
    composed: Annotated[bool, typer.Option(help="all nodes in one process, or one process a node")] = True,
    limit_mb: Annotated[float, typer.Option(help="what every process must stay below [MB]")] = 300.0,
    out: Annotated[
        Path | None, typer.Option(help="keep the run here; default: removed in the end", show_default=False)
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="A.B=VALUE", help="change one key of the scenario; repeatable", show_default=False
        ),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="print the result as one JSON document")] = False,
) -> None:
    """Run in lockstep over ROS 2, check the bag, replay it, compare every bit; print the peak memory of each process.

    An hour of six DGUs takes ten minutes to half an hour, and half a gigabyte of disk.
    """
    messages = Console(stderr=True)
    arguments = [scenario, "--duration", str(duration), *(["--composed"] if composed else [])]
    arguments += [part for one in set_ or [] for part in ("--set", one)]
    with tempfile.TemporaryDirectory() as folder, messages.status("") as status:
        report = run_soak(arguments, out or Path(folder) / "run", limit_mb, status.update)
    if json:
        typer.echo(json_module.dumps(report.document()))
    else:
        _print(report)
    raise typer.Exit(0 if report.passed else _EXIT_FAILED)


def _print(report: SoakReport) -> None:
    rows = []
    for stage in report.stages:
        peaks = ", ".join(f"{name}: {peak:.0f}" for name, peak in sorted(stage.peak_mb.items()))
        rows.append((stage.name, f"{stage.wall_sec:.1f}", peaks, stage.detail))
    table = tabulate(("stage", "wall time [s]", "peak memory [MB]", ""), rows, numbers={"wall time [s]"})
    console = Console()
    console.print(table)
    verdict = "passed" if report.passed else f"failed (limit {report.limit_mb:g} MB)"
    console.print(f"{report.steps} steps, {report.megabytes:.1f} MB: {verdict}", highlight=False)
