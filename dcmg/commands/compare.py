"""`dcmg compare`: runs side by side, attack by attack."""

from __future__ import annotations

import json as json_module
from pathlib import Path  # noqa: TC003 (typer reads the annotations)
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from dcmg.errors import CommandError
from dcmg.tabular import tabulate

if TYPE_CHECKING:
    from collections.abc import Sequence

_FEWEST = 2


def compare(
    runs: Annotated[
        list[Path], typer.Argument(metavar="BAG BAG...", help="bags, or reports (report.json)", show_default=False)
    ],
    *,
    json: Annotated[bool, typer.Option("--json", help="print the documents of all runs as one")] = False,
) -> None:
    """Put runs side by side: each attack's delay, false alarms, and what watched."""
    if len(runs) < _FEWEST:
        raise CommandError(f"{runs[0]}: expected two runs or more to compare")
    documents = {str(path): _document(path) for path in runs}
    if json:
        typer.echo(json_module.dumps(documents))
        return
    rows = [(name, *cells) for name, cells in side_by_side(list(documents.values()))]
    Console().print(tabulate(("", *_names(runs)), rows))


def side_by_side(documents: Sequence[dict[str, Any]]) -> list[tuple[str, list[str]]]:
    """Name of each row, and its cell for each run."""
    keys = [_key(attack) for one in documents for attack in one["attacks"]]
    rows = []
    for kind, links, start in dict.fromkeys(keys):
        found = [
            next((_seen(attack) for attack in one["attacks"] if _key(attack) == (kind, links, start)), "-")
            for one in documents
        ]
        rows.append((f"{kind} on {links} from {start:g} s", found))
    alarms = [str(sum(link["alarms"] for link in one["links"])) for one in documents]
    false = ["" if one["labelled"] else " (not known whether false)" for one in documents]
    rows += [
        ("attacks seen", [_share(one) for one in documents]),
        ("false alarms", [count + note for count, note in zip(alarms, false, strict=True)]),
        ("observers", [", ".join(sorted({link["observer"] for link in one["links"]})) for one in documents]),
        ("judged by", [one["judged_by"] for one in documents]),
        ("scenario, seed", [f"{one['scenario']}, {one['seed']}" for one in documents]),
        ("length", [f"{one['duration_sec']:g} s" for one in documents]),
    ]
    return rows


def _document(path: Path) -> dict[str, Any]:
    """The rows of a run, or those that its report holds."""
    report = path / "report.json" if path.is_dir() and (path / "report.json").is_file() else path
    if report.is_file():
        try:
            document = json_module.loads(report.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            document = None
        if not isinstance(document, dict) or "attacks" not in document or "judged_by" not in document:
            raise CommandError(f"{report}: expected a report.json of `dcmg report`, or a bag's directory")
        return document
    from bags.reporting.documents import run_document  # noqa: PLC0415 (heavy)
    from bags.reporting.judged import judge  # noqa: PLC0415 (heavy)
    from bags.reporting.timeline import gather  # noqa: PLC0415 (heavy)
    from bags.runs.reader import open_run  # noqa: PLC0415 (heavy)
    from dcmg.progress import shown  # noqa: PLC0415 (heavy)

    run = open_run(path)
    timeline = gather(shown(run.windows(), run.steps, str(path)), run.steps)
    return run_document(timeline, judge(timeline), path)


def _names(paths: Sequence[Path]) -> list[str]:
    """Short names: the folders' own, or with what stands before them where two are alike."""
    own = [path.resolve().name for path in paths]
    if len(set(own)) == len(own):
        return own
    return [str(path) for path in paths]


def _key(attack: dict[str, Any]) -> tuple[str, str, float]:
    return attack["kind"], ", ".join(attack["links"]), attack["from_sec"]


def _seen(attack: dict[str, Any]) -> str:
    if not attack["began"]:
        return "never began"
    return f"after {attack['delay_sec']:.2f} s" if attack["seen"] else "missed"


def _share(document: dict[str, Any]) -> str:
    began = [attack for attack in document["attacks"] if attack["began"]]
    return f"{sum(attack['seen'] for attack in began)} of {len(began)}"
