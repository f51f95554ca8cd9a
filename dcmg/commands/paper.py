"""`dcmg paper`: repeat the papers' experiments, draw their figures and check their numbers."""

from __future__ import annotations

import importlib
import json as json_module
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from dcmg.errors import CommandError
from dcmg.tabular import tabulate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dcmg.papers.check import Check

app = typer.Typer(no_args_is_help=True, help="Repeat the papers' experiments and check their numbers.")

_EXIT_FAILED = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperExperiment:
    """One experiment of a paper.

    Attributes:
        module: module of `dcmg.papers` with `run(seed)`, `checks(result)` and `plot(result, out_dir)`; if
            it has `notes(result)`, these lines of Markdown are printed and written, too.
        title: what it shows, in one line.
        picture: file name of the one picture that is meant, None: all that the module draws.
        seed: default seed.
        package: where the module is.
    """

    module: str
    title: str
    picture: str | None = None
    seed: int = 0
    package: str = "dcmg.papers"


EXPERIMENTS = {
    "turan-fig2": PaperExperiment(
        module="turan_2021",
        title="Turan & Ferrari-Trecate 2021, Figure 2: states and estimates of a DGU in safe operation",
        picture="turan_2021_fig2.png",
    ),
    "turan-fig3": PaperExperiment(
        module="turan_2021",
        title="Turan & Ferrari-Trecate 2021, Figure 3: residuals under an attack from step 50 on",
        picture="turan_2021_fig3.png",
    ),
    "ruio-example": PaperExperiment(
        module="ruio_example", title="Data-driven reduced-order UIO: the four-state example, and one that is refused"
    ),
    "dduio": PaperExperiment(
        module="dduio", title="Distributed data-driven UIO: five observers of two masses, three designs compared"
    ),
    "dduio-grid": PaperExperiment(
        module="dduio_grid", title="Distributed data-driven UIO on the microgrid, in sampled time"
    ),
    "dduio-team": PaperExperiment(
        module="team_grid", title="The team of monitors in numbers: structures, couplings, noise, attacks, cost", seed=1
    ),
    "uie": PaperExperiment(
        module="uie", title="Data-driven input reconstruction from outputs: op-UIE and cl-UIE", seed=353
    ),
    "uie-co2": PaperExperiment(
        module="uie_co2", title="Occupancy from CO2, on a SYNTHETIC building: cl-UIE against two regressions"
    ),
    "delayed": PaperExperiment(
        module="delayed", title="Chakrabarty et al. 2017: delayed UIO with guaranteed performance on a DGU"
    ),
    "data-gap": PaperExperiment(
        module="data_gap", title="The price of noisy data: model-based, data-driven and identification-based designs"
    ),
    "which-observer": PaperExperiment(
        module="which_observer", title="Which observer when: what each sees how fast, and what a step costs"
    ),
}


@app.command("list")
def list_() -> None:
    """List the experiments."""
    rows = [(name, experiment.title) for name, experiment in EXPERIMENTS.items()]
    Console().print(tabulate(("experiment", "what it shows"), rows, framed=False))


def add_command(app: typer.Typer, name: str, experiment: PaperExperiment, out_dir: Path) -> None:
    """Add the command that repeats an experiment."""

    def repeat(
        seed: Annotated[int, typer.Option(help="seed of the random data")] = experiment.seed,
        out: Annotated[Path, typer.Option(help="folder for the figure and the numbers")] = out_dir,
        *,
        json: Annotated[bool, typer.Option("--json", help="print the numbers as a JSON document")] = False,
    ) -> None:
        raise typer.Exit(_repeat(name, experiment, seed, out, json=json))

    app.command(name, help=experiment.title, short_help=experiment.title)(repeat)


def _repeat(name: str, experiment: PaperExperiment, seed: int, out: Path, *, json: bool) -> int:
    module: Any = importlib.import_module(f"{experiment.package}.{experiment.module}")
    with Console(stderr=True).status(f"{name}: computing"):
        result = module.run(seed)
        checks: Sequence[Check] = module.checks(result)
        pictures = [path for path in module.plot(result, out) if experiment.picture in {None, path.name}]
    notes: Sequence[str] = module.notes(result) if hasattr(module, "notes") else ()
    document = {
        "experiment": name,
        "title": experiment.title,
        "seed": seed,
        "checks": [{**asdict(check), "ok": check.ok} for check in checks],
        "pictures": [str(path) for path in pictures],
    }
    files = [out / f"{name}.json", *([out / f"{name}.md"] if notes else [])]
    try:
        files[0].write_text(json_module.dumps(document, indent=1) + "\n")
        for file in files[1:]:
            file.write_text("\n".join(notes) + "\n")
    except OSError as error:
        raise CommandError(f"--out {out}: cannot be written ({error.strerror})") from error
    if json:
        typer.echo(json_module.dumps(document))
    else:
        _print(experiment.title, checks, notes, [*pictures, *files])
    return 0 if all(check.ok for check in checks) else _EXIT_FAILED


def _print(title: str, checks: Sequence[Check], notes: Sequence[str], files: Sequence[Path]) -> None:
    console = Console()
    headings = ("checked", "found", "expected", "tolerance", "")
    rows = [
        (one.name, f"{one.value:.6g}", f"{one.expected:.6g}", f"{one.tolerance:g}", "ok" if one.ok else "differs")
        for one in checks
    ]
    styles = [None if one.ok else "bold red" for one in checks]
    table = tabulate(headings, rows, numbers=set(headings[1:4]), styles=styles, title=title)
    console.print(table)
    agree = sum(check.ok for check in checks)
    console.print(f"{agree} of {len(checks)} numbers agree with what is expected")
    for line in notes:
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    for path in files:
        console.print(str(path), highlight=False, markup=False, soft_wrap=True)


for _name, _experiment in EXPERIMENTS.items():
    add_command(app, _name, _experiment, Path("out/paper"))
