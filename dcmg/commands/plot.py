"""`dcmg plot`: a figure of a run for a paper."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 (typer reads the annotations)
from typing import Annotated

import typer

from dcmg.progress import shown


def plot(
    bag: Annotated[Path, typer.Argument(help="bag of a run: recorded, simulated or replayed", show_default=False)],
    *,
    figure: Annotated[
        str,
        typer.Option(
            metavar="KIND",
            help="`residuals` over thresholds, the `components` of one link's residual with units, `states`, `roc`, "
            "`topology`, or `impact` on the grid",
        ),
    ] = "residuals",
    style: Annotated[
        str, typer.Option(metavar="NAME", help="widths, font and size of `ieee`, `elsevier`, `springer` or `nature`")
    ] = "ieee",
    column: Annotated[str, typer.Option(metavar="WIDTH", help="`single` or `double`")] = "single",
    links: Annotated[
        str | None,
        typer.Option(
            metavar="I-J,...",
            help="links to draw, or `all`; default: those that were attacked or alarmed",
            show_default=False,
        ),
    ] = None,
    from_: Annotated[
        float | None, typer.Option("--from", metavar="SECONDS", help="draw from then on", show_default=False)
    ] = None,
    to: Annotated[float | None, typer.Option(metavar="SECONDS", help="draw until then", show_default=False)] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="A.B=VALUE",
            help="judge by other monitors than the recorded ones, as in `monitor.detector={kind: cusum}`; repeatable",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="file to write: .pdf, .svg or .png; default: BAG's name and KIND.pdf", show_default=False),
    ] = None,
) -> None:
    """Draw a run for a paper: vector graphics in the width of a column, fonts embedded, told apart without colour.

    The same run gives the same bytes. From Python: `dcmg.plot(bag, "residuals")` is the matplotlib figure.

    For example:

    `dcmg plot out/bag --figure residuals --links 1-2,4-2 --from 4 --to 8 --out residuals.pdf`

    `dcmg plot out/bag --figure states --style elsevier --column double --out states.svg`
    """
    from bags.reporting.publication.choice import choice_of  # noqa: PLC0415
    from bags.reporting.publication.make import check_path, make_figure, save  # noqa: PLC0415 (heavy)
    from bags.runs.reader import open_run  # noqa: PLC0415 (idem)
    from bags.runs.replay import concluded  # noqa: PLC0415 (idem)

    choice = choice_of(figure, style=style, column=column, links=links, start_sec=from_, stop_sec=to)
    path = out or bag.with_name(f"{bag.resolve().name}_{figure}.pdf")
    check_path(path)
    run = open_run(bag)
    choice.steps(run.steps, run.topics.sampling_period_ns * 1e-9)
    windows = shown(concluded(run.windows(), set_ or ()), run.steps, "reading")
    made = make_figure(windows, run.steps, run.topics.sampling_period_ns * 1e-9, choice)
    save(made, path)
    width, height = made.get_size_inches()
    typer.echo(f"figure: {path} ({width:.2f} in x {height:.2f} in)")
