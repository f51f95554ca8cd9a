"""`dcmg study`: many runs, one table."""

from __future__ import annotations

import json as json_module
import logging
import os
import sys
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from dcmg.errors import CommandError
from dcmg.progress import CountBar
from dcmg.shipped import scenario_path
from dcmg.suggest import did_you_mean
from dcmg.tabular import tabulate

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from bags.study import Comparison, Pool, StudyCell

_EXIT_INTERRUPTED = 130
_PIPED_WIDTH = 160


def shipped_studies() -> dict[str, Path]:
    """Return the studies that come with the package: name → file."""
    folder = Path(str(resources.files("dcmg") / "studies"))
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}


Name = Annotated[
    str | None, typer.Argument(help="name of a shipped study (see `--list`) or path of a YAML file", show_default=False)
]
Out = Annotated[
    Path | None, typer.Option(help="folder to write to, and to go on in; default: out/study-NAME", show_default=False)
]
Seeds = Annotated[int | None, typer.Option(min=1, help="how many seeds; default: the study's", show_default=False)]
Workers = Annotated[int | None, typer.Option(min=1, help="processes; default: one a core", show_default=False)]
Dask = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="compute on Dask: tcp://HOST:PORT, a scheduler file, or local[:N] (docs/cluster.md)",
        show_default=False,
    ),
]
Planned = Annotated[
    int | None,
    typer.Option(
        "--plan",
        min=1,
        metavar="WORKERS",
        help="compute one cell of each kind, and tell what all would cost on so many workers",
        show_default=False,
    ),
]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="A.B=VALUE", help="change one key of the study; repeatable", show_default=False),
]


def study(
    study: Name = None,
    *,
    list_: Annotated[bool, typer.Option("--list", help="list the shipped studies and end")] = False,
    out: Out = None,
    seeds: Seeds = None,
    workers: Workers = None,
    dask: Dask = None,
    plan: Planned = None,
    set_: Set = None,
    json: Annotated[bool, typer.Option("--json", help="print the comparison as one JSON document")] = False,
) -> None:
    """Run seeds x attacks x observers x detectors offline, and compare them.

    Writes the Parquet data set table (one row for each run, link and operating point), comparison.csv, comparison.md,
    and ROC, delay and impact curves. An interrupted study goes on where it was when the same command is given again.
    docs/studies.md explains the keys of a study file, docs/cluster.md many machines.
    """
    from bags.study import (  # noqa: PLC0415 (pyarrow takes its time)
        cells_of,
        check_designs,
        compare,
        load_study,
        operating_points,
        tables_of,
    )
    from bags.study.figures import write_results  # noqa: PLC0415 (idem)
    from bags.study.page import write_page  # noqa: PLC0415 (idem)

    if list_ or study is None:
        _list(json=json)
        return
    path = _study_path(study)
    overrides = [*(set_ or []), *([] if seeds is None else [f"seeds={seeds}"])]
    loaded = load_study(path, overrides)

    def find(name: str) -> Path:
        beside = path.parent / name
        return beside if beside.is_file() else scenario_path(name)

    cells = cells_of(loaded, str(path), find)
    check_designs(loaded, cells, str(path))
    if plan is not None:
        _show_plan(cells, plan, json=json)
        return
    folder = out or Path("out") / f"study-{loaded.name}"
    with _pool(workers, dask) as pool:
        table = _run(cells, folder, pool, quiet=json)
    points = operating_points(tables_of(table))
    comparisons = compare(points, loaded.false_alarm_limit)
    paths = [table, *write_results(points, comparisons, loaded.false_alarm_limit, folder)]
    paths.append(write_page(loaded, points, comparisons, folder))
    if json:
        best = [
            {"condition": one.condition, "attack": one.attack, "best": one.best and one.best.row()}
            for one in comparisons
        ]
        typer.echo(json_module.dumps({"study": loaded.name, "comparison": best, "files": [str(one) for one in paths]}))
        return
    _show(loaded.question, comparisons, loaded.false_alarm_limit)
    for one in paths:
        typer.echo(one)


def _show_plan(cells: Sequence[StudyCell], workers: int, *, json: bool) -> None:
    from bags.study import plan_of  # noqa: PLC0415 (pyarrow takes its time)

    rows = list(plan_of(cells).rows(workers))
    if json:
        typer.echo(json_module.dumps(dict(rows)))
        return
    Console().print(tabulate(("what", "measured here"), rows, numbers={"measured here"}))


@contextmanager
def _pool(workers: int | None, dask: str | None) -> Iterator[Pool]:
    """Who computes."""
    from bags.study import LocalPool  # noqa: PLC0415 (pyarrow takes its time)

    if dask is None:
        yield LocalPool(workers or os.cpu_count() or 1)
        return
    if workers is not None:
        raise CommandError(f"--workers {workers}: expected either this or --dask {dask}: write --dask local:{workers}")
    try:
        from bags.study.cluster import dask_pool  # noqa: PLC0415 (idem, and only here)
    except ModuleNotFoundError as error:
        raise CommandError(
            f"--dask needs the Python package {error.name}, found none: pip install 'dcmg[studies]'"
        ) from error
    for name in ("distributed", *logging.root.manager.loggerDict):
        if name.startswith("distributed"):
            logging.getLogger(name).setLevel(logging.CRITICAL)  # what matters is said in our own words
    with dask_pool(dask) as pool:
        yield pool


def _run(cells: Sequence[StudyCell], folder: Path, pool: Pool, *, quiet: bool) -> Path:
    from bags.study import run_study  # noqa: PLC0415 (pyarrow takes its time)

    done = 0
    with CountBar("cells", quiet=quiet) as bar:

        def show(finished: int, total: int) -> None:
            nonlocal done
            done = finished
            bar.show(finished, total)

        try:
            return run_study(cells, folder, pool, show, bar.say)
        except KeyboardInterrupt:
            typer.echo(
                f"dcmg: interrupted; {done} of {len(cells)} cells are kept in {folder}: start again to go on", err=True
            )
            raise typer.Exit(_EXIT_INTERRUPTED) from None


def _study_path(name_or_path: str) -> Path:
    path = Path(name_or_path)
    if path.is_file():
        return path
    shipped = shipped_studies()
    if name_or_path in shipped:
        return shipped[name_or_path]
    raise CommandError(f"{name_or_path}: no such study; {did_you_mean(name_or_path, shipped)}, or a path to a file")


def _list(*, json: bool) -> None:
    from bags.study import load_study  # noqa: PLC0415 (pyarrow takes its time)

    found = {name: load_study(path) for name, path in shipped_studies().items()}
    runs = {name: len(one.conditions) * (len(one.attacks) + 1) * one.seeds for name, one in found.items()}
    if json:
        files = shipped_studies()
        document = [
            {"name": name, "question": one.question, "runs": runs[name], "file": str(files[name])}
            for name, one in found.items()
        ]
        typer.echo(json_module.dumps(document))
        return
    rows = [(name, one.question, str(runs[name])) for name, one in found.items()]
    Console().print(tabulate(("study", "question", "runs"), rows, numbers={"runs"}))


def _show(question: str, comparisons: Sequence[Comparison], limit: float) -> None:
    from bags.study.figures import COLUMNS, cells  # noqa: PLC0415 (matplotlib takes its time)

    table = tabulate(COLUMNS, map(cells, comparisons), title=question)
    Console(width=None if sys.stdout.isatty() else _PIPED_WIDTH).print(table)
    typer.echo(f"best: most runs detected, then the shortest delay, with at most {limit:g} false alarms per sample")
