"""`dcmg reproduce` and `dcmg script`: a run again, from nothing but its bag."""

from __future__ import annotations

import json as json_module
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer
from rich.console import Console

from dcmg.errors import CommandError
from dcmg.tabular import tabulate

_EXIT_DIFFERS = 1


def reproduce(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="bag of a run", show_default=False)],
    *,
    out: Annotated[
        Path | None, typer.Option(help="keep the bag that is made again in this new folder", show_default=False)
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="print the result as a JSON document")] = False,
) -> None:
    """Run a bag's scenario again, attacks by hand included, and say whether every message is the same, bit for bit.

    Exit code 1: some are not. The designs are those of the bag, so that other processors give the same bits.
    """
    from bags.runs.reader import open_run  # noqa: PLC0415 (heavy)
    from bags.runs.reproduce import reproduce as again  # noqa: PLC0415 (heavy)
    from dcmg.commands.showing import messages  # noqa: PLC0415 (heavy)
    from dcmg.live import LiveDisplay  # noqa: PLC0415 (heavy)

    if out is not None and out.exists():
        raise CommandError(f"--out {out}: expected a new folder")
    run = open_run(bag)
    with (
        TemporaryDirectory(prefix="dcmg-reproduce-") as folder,
        closing(LiveDisplay(messages, run.steps, run.topics.sampling_period_ns * 1e-9)) as display,
    ):
        found = again(bag, out or Path(folder) / "bag", display.steps)
    for line in found.plug_ins:
        messages.print(line, highlight=False, markup=False, soft_wrap=True)
    if json:
        typer.echo(json_module.dumps(found.document()))
    else:
        for topic, why in found.left_out.items():
            typer.echo(f"not compared: {topic}: {why}")
        if found.differing:
            rows = [(topic, f"{first}", f"{old}", f"{new}") for topic, (first, old, new) in found.differing.items()]
            Console().print(tabulate(("topic", "first that differs", "recorded", "made again"), rows))
        same = f"{found.topics - len(found.differing)} of {found.topics} topics are bit-identical"
        typer.echo(f"{same}, {found.messages} messages compared")
    raise typer.Exit(_EXIT_DIFFERS if found.differing else 0)


def script(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="bag of a run", show_default=False)],
    *,
    out: Annotated[
        Path | None, typer.Option(help="file to write; default: standard output", show_default=False)
    ] = None,
) -> None:
    """Write what was done to a run by hand as a scenario, whose run gives the same bytes."""
    from bags.runs.reproduce import steered  # noqa: PLC0415 (heavy)

    text = steered(bag).to_yaml()
    if out is None:
        typer.echo(text, nl=False)
        return
    if out.exists():
        raise CommandError(f"--out {out}: exists already, expected a new file")
    out.write_text(text, encoding="utf-8")
