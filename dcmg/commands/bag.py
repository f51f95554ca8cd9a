"""`dcmg bag`: look into bags, export, check and repair them."""

from __future__ import annotations

import json as json_module
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from bags.mcap.bag import open_bag
from bags.mcap.check import check as check_bag
from bags.mcap.repair import repair as repair_bag
from bags.tables.export import TableFormat
from bags.tables.export import export as export_bag

_EXIT_DAMAGED = 1

app = typer.Typer(no_args_is_help=True, help="Look into recorded bags, export, check and repair them.")

Bag = Annotated[Path, typer.Argument(help="a bag's directory, or one MCAP file", show_default=False)]
Json = Annotated[bool, typer.Option("--json", help="print the result as one JSON document, and nothing else there")]


@app.command()
def info(bag: Bag, *, json: Json = False) -> None:
    """Show topics, counts, duration and attachments of a bag."""
    found = open_bag(bag)
    duration_sec = (found.end_ns - found.start_ns) * 1e-9
    messages = sum(topic.count for topic in found.topics.values())
    if json:
        topics = [{"name": one.name, "type": one.type_name, "count": one.count} for one in found.topics.values()]
        document = {
            "bag": str(bag),
            "messages": messages,
            "start_ns": found.start_ns,
            "duration_sec": duration_sec,
            "topics": topics,
            "attachments": sorted(found.attachments),
        }
        typer.echo(json_module.dumps(document))
        return
    table = Table("topic", "type", "messages")
    for topic in found.topics.values():
        table.add_row(topic.name, topic.type_name, str(topic.count))
    Console().print(table)
    typer.echo(f"{messages} messages over {duration_sec:g} s; attachments: {', '.join(found.attachments) or 'none'}")


@app.command()
def export(
    bag: Bag,
    *,
    out: Annotated[Path, typer.Option(help="folder for the tables; new or empty")],
    form: Annotated[TableFormat, typer.Option("--format", help="kind of the files")] = TableFormat.CSV,
) -> None:
    """Write one table a topic, or a run as one netCDF file with dimensions and units."""
    report = export_bag(bag, out, form)
    typer.echo(f"{len(report.files)} file(s) are in {out}")
    if report.left_out:
        typer.echo(f"left out (no messages, or of an unknown type): {' '.join(report.left_out)}")


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
