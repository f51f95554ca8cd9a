"""`dcmg bag`: check and repair bags."""

from __future__ import annotations

import json as json_module
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from bags.check import check as check_bag
from bags.repair import repair as repair_bag

_EXIT_DAMAGED = 1

app = typer.Typer(no_args_is_help=True, help="Check and repair recorded bags.")

Bag = Annotated[Path, typer.Argument(help="a bag's directory, or one MCAP file", show_default=False)]
Json = Annotated[bool, typer.Option("--json", help="print the result as one JSON document, and nothing else there")]


@app.command()
def check(bag: Bag, *, json: Json = False) -> None:
    """Verify every check sum and say what is intact; exit code 1 when something is not."""
    report = check_bag(bag)
    if json:
        typer.echo(json_module.dumps(report.document()))
    else:
        table = Table("file", "bytes", "sound chunks", "intact messages", "attachments")
        for file in report.files:
            cells = (file.name, file.size, file.chunks, sum(file.messages.values()), ", ".join(file.attachments))
            table.add_row(*(str(cell) for cell in cells))
        Console().print(table)
        for damage in report.damages:
            typer.echo(str(damage))
        typer.echo("the bag is clean" if report.clean else f"damaged: `dcmg bag repair {bag}` keeps what is intact")
    raise typer.Exit(0 if report.clean else _EXIT_DAMAGED)


@app.command()
def repair(
    bag: Bag,
    *,
    out: Annotated[
        Path | None, typer.Option(help="the new bag; default: the old one's name and _repaired", show_default=False)
    ] = None,
    json: Json = False,
) -> None:
    """Write a valid bag with every message that is intact; the damaged one stays as it is."""
    report = repair_bag(bag, out or bag.with_name(f"{bag.stem if bag.is_file() else bag.name}_repaired"))
    if json:
        typer.echo(json_module.dumps(report.document()))
        return
    for damage in report.damages:
        typer.echo(str(damage))
    typer.echo(f"{report.messages} messages of {report.chunks} sound chunks are in {report.path}")
    if report.salvaged:
        typer.echo(f"{report.salvaged} more stood in the broken-off last chunk: no check sum vouches for them")
    if report.undescribed:
        typer.echo(f"{report.undescribed} intact messages were left out: nothing says on which topic they were")
