"""`dcmg import`: measurements from outside as histories."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bags.tables import Column, TableMapping, import_history

app = typer.Typer(no_args_is_help=True, help="Bring measurements from outside in.")


Table = Annotated[Path, typer.Argument(help="CSV with names in its first row, or Parquet", show_default=False)]
Out = Annotated[Path, typer.Option(help="bag to write; must not exist")]


@app.callback()
def main() -> None:
    """Bring measurements from outside in."""


@app.command()
def history(
    table: Table,
    *,
    dgu: Annotated[int, typer.Option(min=1, help="number of the DGU that was measured")],
    y: Annotated[list[str], typer.Option(help="column of an output, name or name*factor to SI; repeatable")],
    out: Out,
    x: Annotated[list[str] | None, typer.Option(help="column of a state; default: the outputs are the states")] = None,
    u: Annotated[list[str] | None, typer.Option(help="column of a known input; default: none")] = None,
    time: Annotated[str | None, typer.Option(help="column of the instants, times its factor in seconds")] = None,
    period: Annotated[float | None, typer.Option(help="sampling period [s]; default: median of the instants")] = None,
) -> None:
    """Write a table of measurements as a history, from which `dcmg run --history` designs monitors."""
    mapping = TableMapping(
        u=tuple(Column.parse(one) for one in u or ()),
        y=tuple(Column.parse(one) for one in y),
        x=tuple(Column.parse(one) for one in x or ()),
        time=Column.parse(time) if time else None,
        sampling_period_sec=period,
    )
    report = import_history(table, dgu, mapping, out)
    for row, length_sec in report.gaps:
        typer.echo(f"gap of {length_sec:g} s before row {row}: a new experiment starts there")
    if report.dropped:
        typer.echo(f"{report.dropped} rows stand alone between gaps and were left out")
    samples = sum(len(record.y) for record in report.records)
    typer.echo(f"{samples} samples in {len(report.records)} experiments of DGU {dgu} are in {out}")
