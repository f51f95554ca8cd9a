"""`dcmg reconstruct`: what acted on a DGU, and what was falsified on a link, from a recorded run."""

from __future__ import annotations

import json as json_module
from math import isfinite
from pathlib import Path  # noqa: TC003 (typer reads the annotations)
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from dcmg.commands.design import named_values
from dcmg.errors import CommandError
from dcmg.tabular import tabulate
from monitor.input_estimators import KINDS

if TYPE_CHECKING:
    from bags.reconstruct.reconstruction import Reconstruction

_NOISE_COMPONENTS = 3


def reconstruct(
    bag: Annotated[Path, typer.Argument(help="bag of a run")],
    *,
    link: Annotated[str, typer.Option(help="link from the sending to the receiving DGU, as in 1-2")],
    estimator: Annotated[str, typer.Option(help=f"input estimator: {', '.join(sorted(KINDS))}")] = "delayed",
    option: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="option of the estimator, as in `delay=2`; repeatable"),
    ] = None,
    start: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="start of the attack; default: first alarm on the link"),
    ] = None,
    stop: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="end of the attack; default: end of the last alarm")
    ] = None,
    noise_std: Annotated[
        str | None,
        typer.Option(metavar="V,A,VS", help="noise on (V, I_t, v); default: equal, as the calm estimates spread"),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="folder for the picture; default: none is drawn")] = None,
    json: Annotated[bool, typer.Option("--json", help="print the result as one JSON document")] = False,
) -> None:
    """Reconstruct load, reference and attack on one link from what was received and the offline history.

    As many unknown inputs as outputs less one leave room for one falsified output: each is measured as if it alone were
    false, whatever the load did; and all together as if the load had stayed. Simulated runs show the truth beside it.
    """
    from bags.reconstruct.estimate import reconstruct_link  # noqa: PLC0415 (heavy)
    from dgu_sim.grid import Link  # noqa: PLC0415 (heavy)

    found = reconstruct_link(
        bag,
        Link.parse(link),
        estimator=estimator,
        options=named_values(option or []),
        window_sec=(start, stop),
        noise_std=_noise(noise_std),
    )
    picture = None
    if out is not None:
        from bags.reconstruct.reconstruction_plot import draw_reconstruction  # noqa: PLC0415 (heavy)

        picture = draw_reconstruction(found, out)
    if json:
        typer.echo(json_module.dumps({**found.document(), "picture": None if picture is None else str(picture)}))
        return
    _print(found)
    if picture is not None:
        Console().print(f"plot: {picture}", highlight=False, markup=False, soft_wrap=True)


def _noise(text: str | None) -> tuple[float, float, float] | None:
    if text is None:
        return None
    try:
        numbers = [float(one) for one in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != _NOISE_COMPONENTS or not all(isfinite(one) and one >= 0.0 for one in numbers):
        raise CommandError(f"--noise-std {text}: expected three numbers, as in 0.001,0.001,0.0001")
    return (numbers[0], numbers[1], numbers[2])


def _print(found: Reconstruction) -> None:
    from bags.reconstruct.reconstruction import INPUT_UNITS, INPUTS, OUTPUT_UNITS, OUTPUTS  # noqa: PLC0415 (heavy)

    console = Console()
    console.print(f"{found.estimator}: {found.verdict}", highlight=False, markup=False, soft_wrap=True)
    errors = found.input_error()
    for name, unit, width, error in zip(INPUTS, INPUT_UNITS, found.input_uncertainty, errors, strict=False):
        line = f"{name}: ± {_number(width)} {unit} (2 sigma and bound); rms error of calm steps {_number(error)} {unit}"
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    if found.spans.attack[0] == found.spans.attack[1]:
        console.print(f"attack: not measured: {found.vector_reason}", highlight=False, markup=False, soft_wrap=True)
        return
    start, stop = (found.time_sec[min(step, len(found.time_sec) - 1)] for step in found.spans.attack)
    rows = []
    for one in found.hypotheses:
        channel = found.channels[one.channel]
        moved = ", ".join(f"{_number(change)} {unit}" for change, unit in zip(one.change, INPUT_UNITS, strict=False))
        cells = (_number(one.magnitude), _number(one.uncertainty), _number(found.truth(channel)))
        rows.append((f"{OUTPUTS[channel]} alone [{OUTPUT_UNITS[channel]}]", *cells, moved))
    if found.vector is not None:
        for row, channel in enumerate(found.channels):
            size, width = found.vector.magnitude[row], found.vector.uncertainty[row]
            name, truth = f"{OUTPUTS[channel]} of all [{OUTPUT_UNITS[channel]}]", found.truth(channel)
            rows.append((name, _number(size), _number(width), _number(truth), "none: taken to stay"))
    headings = ("falsified", "measured", "± 2 sigma", "simulator", "inputs would have moved by")
    title = f"attack from {start:g} s to {stop:g} s"
    console.print(tabulate(headings, rows, numbers=set(headings[1:4]), title=title, framed=False))
    for one in found.hypotheses:
        if not isfinite(one.magnitude):
            console.print(
                f"{OUTPUTS[found.channels[one.channel]]}: {one.verdict}", highlight=False, markup=False, soft_wrap=True
            )
    if found.vector is None:
        console.print(f"all outputs together: {found.vector_reason}", highlight=False, markup=False, soft_wrap=True)


def _number(value: float) -> str:
    return f"{value:.3g}" if isfinite(value) else "-"
