"""`dcmg measure import`: does an import stay within bounded memory, however long the recording is?"""

from __future__ import annotations

import json as json_module
import tempfile
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from dcmg.tabular import tabulate

_EXIT_FAILED = 1


def measure_import(
    *,
    minutes: Annotated[float, typer.Option(min=0.01, help="length of the recording")] = 60.0,
    topics: Annotated[int, typer.Option(min=1, max=100, help="how many, each of one output")] = 20,
    rate: Annotated[int, typer.Option(min=1, metavar="HZ", help="messages a second on each")] = 100,
    limit_mb: Annotated[float, typer.Option(help="what every command must stay below [MB]")] = 300.0,
    json: Annotated[bool, typer.Option("--json", help="print the result as one JSON document")] = False,
) -> None:
    """Record topics with the mcap library, import them as a history and as a stream, print time and peak memory.

    The default, an hour of twenty topics, takes some ten minutes and half a gigabyte of disk.
    """
    from dcmg.measures.import_memory import import_memory  # noqa: PLC0415 (heavy)

    with tempfile.TemporaryDirectory(prefix="dcmg_") as folder, Console(stderr=True).status("") as status:
        samples = max(round(minutes * 60 * rate), 2)
        found = import_memory(Path(folder), (samples, topics), rate, limit_mb, status.update)
    if json:
        typer.echo(json_module.dumps(found.document()))
    else:
        rows = [(one.command, f"{one.wall_sec:.1f}", f"{one.peak_mb:.0f}", one.detail) for one in found.imports]
        console = Console()
        console.print(tabulate(("import", "wall time [s]", "peak memory [MB]", ""), rows, numbers={"wall time [s]"}))
        verdict = "passed" if found.passed else f"failed (limit {limit_mb:g} MB)"
        console.print(f"{found.messages} messages, {found.megabytes:.1f} MB: {verdict}", highlight=False)
    raise typer.Exit(0 if found.passed else _EXIT_FAILED)
