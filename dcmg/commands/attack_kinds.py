"""`dcmg attack kinds`: what attacks there are; what one does, knows and wants."""

from __future__ import annotations

import json as json_module
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from dcmg.attack_words import EXAMPLES, first_line, parameters_of
from dcmg.tabular import tabulate
from dgu_sim.attacks import known_kind, usable_kinds
from dgu_sim.attacks.techniques import techniques_of

if TYPE_CHECKING:
    from dgu_sim.attacks import Attack


def attack_kinds(
    kind: Annotated[str | None, typer.Argument(help="show this one with its parameters", show_default=False)] = None,
    *,
    json: Annotated[bool, typer.Option("--json", help="print a JSON document")] = False,
) -> None:
    """Say what attacks there are; what one does, knows and wants."""
    chosen, unusable = usable_kinds() if kind is None else ({kind: known_kind(kind)}, [])
    for line in unusable:
        typer.echo(line, err=True)
    if json:
        document = {
            name: {
                "does": first_line(attack),
                "knows": attack.knows,
                "techniques": _techniques(name),
                "parameters": attack.model_json_schema(),
            }
            for name, attack in chosen.items()
        }
        typer.echo(json_module.dumps(document))
        return
    if kind is None:
        headings = ("kind", "what it does", "what it must know", "MITRE ATT&CK for ICS")
        rows = [(name, first_line(one), one.knows, "\n".join(_techniques(name))) for name, one in chosen.items()]
        Console().print(tabulate(headings, rows))
        return
    attack = chosen[kind]
    typer.echo(f"{kind}: {_text(attack.__doc__ or '')}\nThe attacker must know: {attack.knows}.")
    typer.echo(f"MITRE ATT&CK for ICS: {', '.join(_techniques(kind)) or 'no technique that matches'}.")
    table = tabulate(("parameter", "default", "meaning"), parameters_of(attack))
    Console().print(table if attack.model_fields else "no parameters")
    typer.echo(f"dcmg attack start {kind} {EXAMPLES.get(kind) or _example(attack)}")


def _example(attack: type[Attack]) -> str:
    """The words of a kind that brings no example: what it must be told."""
    wanted = [f"{option} ..." for option, default, _ in parameters_of(attack) if default == "required"]
    return " ".join(["1-2", *wanted])


def _techniques(kind: str) -> list[str]:
    return [str(one) for one in techniques_of(kind)]


def _text(docstring: str) -> str:
    return " ".join(docstring.split()).replace("theory section", "docs/theory.md, section")
