"""`dcmg bag`: look into bags, export, check and repair them."""

from __future__ import annotations

import json as json_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from bags.tables.table_format import TableFormat
from dcmg.commands.definitions import EXIT_LEFT_OUT, Definitions, known_definitions
from dcmg.tabular import tabulate

if TYPE_CHECKING:
    from bags.mcap.repair import RepairReport

_EXIT_DAMAGED = 1

app = typer.Typer(no_args_is_help=True, help="Look into recorded bags, export, check and repair them.")

Bag = Annotated[Path, typer.Argument(help="a bag's directory, or one MCAP file", show_default=False)]
Json = Annotated[bool, typer.Option("--json", help="print the result as one JSON document, and nothing else there")]


@app.command()
def info(bag: Bag, *, definitions: Definitions = None, json: Json = False) -> None:
    """Show topics, counts, duration and attachments of a bag, and which topics cannot be read."""
    from bags.sources.contents import contents  # noqa: PLC0415 (heavy)

    found = contents(bag, known_definitions(definitions))
    if json:
        typer.echo(json_module.dumps({"bag": str(bag), **found.document()}))
    else:
        rows = [(topic.name, topic.type_name, str(topic.count)) for topic in found.topics]
        Console().print(tabulate(("topic", "type", "messages"), rows, numbers={"messages"}))
        for note in found.notes:
            typer.echo(note)
        duration_sec = (found.end_ns - found.start_ns) * 1e-9
        attachments = ", ".join(sorted(found.attachments)) or "none"
        typer.echo(f"{found.messages} messages over {duration_sec:g} s; attachments: {attachments}")


@app.command()
def export(
    bag: Bag,
    *,
    out: Annotated[Path, typer.Option(help="folder for the tables; new or empty")],
    form: Annotated[TableFormat, typer.Option("--format", help="kind of the files")] = TableFormat.CSV,
    definitions: Definitions = None,
) -> None:
    """Write one table a topic, or a run as one netCDF file with dimensions and units.

    Exit code 3 when a topic with messages cannot be read: it is named, counted and left out.
    """
    from bags.tables.export import export as export_bag  # noqa: PLC0415 (heavy)

    report = export_bag(bag, out, form, known_definitions(definitions))
    for note in report.notes:
        typer.echo(note)
    typer.echo(f"{len(report.files)} file(s) are in {out}")
    empty = [topic for topic in report.left_out if topic not in report.unreadable]
    if empty:
        typer.echo(f"left out, without messages: {' '.join(empty)}")
    for topic, reason in report.unreadable.items():
        typer.echo(f"left out: {topic}, {reason}", err=True)
    if report.unreadable:
        raise typer.Exit(EXIT_LEFT_OUT)


@app.command()
def check(bag: Bag, *, json: Json = False) -> None:
    """Verify every check sum and say what is intact; exit code 1 when something is not."""
    from bags.mcap.check import check as check_bag  # noqa: PLC0415 (heavy)

    report = check_bag(bag)
    if json:
        typer.echo(json_module.dumps(report.document()))
    else:
        headings = ("file", "bytes", "sound chunks", "intact messages", "attachments")
        rows = [
            (file.name, str(file.size), str(file.chunks), str(sum(file.messages.values())), ", ".join(file.attachments))
            for file in report.files
        ]
        Console().print(tabulate(headings, rows, numbers=set(headings[1:4])))
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
    """Write a valid bag with every message that is intact; the damaged one stays as it is.

    Exit code 3 when intact messages are left out, because nothing says what they are: they are named and counted.
    """
    from bags.mcap.repair import repair as repair_bag  # noqa: PLC0415 (heavy)

    report = repair_bag(bag, out or bag.with_name(f"{bag.stem if bag.is_file() else bag.name}_repaired"))
    if json:
        typer.echo(json_module.dumps(report.document()))
    else:
        _tell_repair(report)
    if report.undescribed:
        raise typer.Exit(EXIT_LEFT_OUT)


def _tell_repair(report: RepairReport) -> None:
    for damage in report.damages:
        typer.echo(str(damage))
    typer.echo(f"{report.messages} messages of {report.chunks} sound chunks are in {report.path}")
    if report.salvaged:
        typer.echo(f"{report.salvaged} more stood in the broken-off last chunk: no check sum vouches for them")
    for topic, what in report.left_out.items():
        typer.echo(f"left out: {topic}, {what}", err=True)
