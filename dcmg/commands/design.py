"""`dcmg design`: an observer from a recorded history, and the certificate that says what it can and cannot see."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 (typer reads the annotations)
from typing import TYPE_CHECKING, Annotated

import typer
import yaml
from rich.console import Console

from dcmg.errors import CommandError
from dgu_sim.yaml_limits import load_within_limits
from monitor.observers import KINDS

if TYPE_CHECKING:
    from collections.abc import Sequence

_EXIT_REFUSED = 1


def design(
    history: Annotated[Path, typer.Argument(help="bag with recorded histories, from `dcmg experiment` or of a run")],
    *,
    dgu: Annotated[int, typer.Option(help="number of the DGU to watch")] = 1,
    observer: Annotated[str, typer.Option(help=f"design method: {', '.join(sorted(KINDS))}")] = "full_order",
    option: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help="option of the design, as in `unknown_inputs=2` or `strategy=max_sensitivity`; repeatable",
            show_default=False,
        ),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="print the certificate as a JSON document")] = False,
) -> None:
    """Design an observer from a recorded history and print its certificate; exit code 1 when the design is refused."""
    from bags.watch.histories import read_histories  # noqa: PLC0415 (heavy)
    from bags.wire.convert import history_of  # noqa: PLC0415 (heavy)
    from monitor import observers  # noqa: PLC0415 (heavy)
    from monitor.wording import describe  # noqa: PLC0415 (heavy)

    options = named_values(option or [])
    made = observers.design(observer, history_of(read_histories(history, dgu)), options)
    if json:
        typer.echo(made.certificate.to_json())
    else:
        console = Console()
        for line in describe(made.certificate):
            console.print(line, highlight=False, markup=False, soft_wrap=True)
    raise typer.Exit(0 if made.accepted else _EXIT_REFUSED)


def named_values(texts: Sequence[str]) -> dict[str, object]:
    """Parse options NAME=VALUE, the values as YAML.

    Raises:
        CommandError: one is neither.
    """
    return dict(_option(text) for text in texts)


def _option(text: str) -> tuple[str, object]:
    name, equals, value = text.partition("=")
    if not equals or not name.strip():
        raise CommandError(f"--option {text}: expected NAME=VALUE, like unknown_inputs=2")
    try:
        return name.strip(), load_within_limits(value)
    except yaml.YAMLError:
        raise CommandError(f"--option {text}: expected a YAML value behind the =") from None
