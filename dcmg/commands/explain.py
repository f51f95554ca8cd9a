"""`dcmg explain`: why there was, or was no, alarm."""

from __future__ import annotations

import json as json_module
from math import isfinite
from pathlib import Path  # noqa: TC003 (typer reads the annotations)
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from dcmg.explaining import Explanation


def explain(
    bag: Annotated[Path, typer.Argument(help="bag of a run: recorded, simulated or replayed", show_default=False)],
    *,
    link: Annotated[str, typer.Option(metavar="I-J", help="from the watched DGU to the one that monitors it")],
    at: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            help="the moment; default: the first alarm on the link, else where the residual came closest to one",
            show_default=False,
        ),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="print the explanation as one JSON document")] = False,
) -> None:
    """Say why there was, or was no, alarm on a link: which test, how close, what the observer can see, what went on."""
    from bags.runs.reader import open_run  # noqa: PLC0415 (heavy)
    from dcmg.explaining import explain as explained  # noqa: PLC0415 (idem)
    from dgu_sim.grid import Link  # noqa: PLC0415 (idem)

    found = explained(open_run(bag), Link.parse(link), at)
    if json:
        typer.echo(json_module.dumps(found.document()))
        return
    for line in _lines(found):
        typer.echo(line)


def _lines(found: Explanation) -> list[str]:
    why = f" ({found.chosen})" if found.chosen else ""
    lines = [f"link {found.link} at {found.time_sec:g} s, step {found.step}{why}", found.conclusion, ""]
    if found.components:
        lines.append("residual against threshold:")
        lines += [
            f"  {one.name:4} {one.residual:9.3g} of {one.threshold:9.3g} {one.unit:4} x {one.ratio:.3g}"
            if isfinite(one.threshold)
            else f"  {one.name:4} {one.residual:9.3g} {one.unit} (no threshold yet)"
            for one in found.components
        ]
    if found.before:
        told = ", ".join(f"{one['time_sec']:g} s: {_ratio(one)}" for one in found.before)
        lines.append(f"largest |r|/threshold of the samples before: {told}")
    for heading, some in (
        ("what this observer can see", found.sight),
        ("attacks on the link", found.attacks or ("none near this moment",)),
        ("faults of its stream", found.streams or ("none near this moment",)),
    ):
        lines += [f"{heading}:", *(f"  {one}" for one in some)]
    return lines


def _ratio(sample: dict[str, Any]) -> str:
    if not sample["delivered"]:
        return "lost"
    return "-" if sample["ratio"] is None else f"{sample['ratio']:.3g}"
