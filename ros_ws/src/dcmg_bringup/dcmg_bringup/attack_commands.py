"""`dcmg attack`: start, stop and list attacks in a running system, and say what attacks there are."""

from __future__ import annotations

import json as json_module
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from dcmg_bringup.attack_client import attack_client
from dcmg_bringup.attack_words import EXAMPLES, first_line, parameters_of, parse_link, parse_order
from dgu_sim.attacks import KINDS, known_kind

app = typer.Typer(no_args_is_help=True, help="Start, stop and list attacks in a running system.")

Domain = Annotated[
    int | None, typer.Option(help="ROS domain id of the system; default: the only one running", show_default=False)
]
Json = Annotated[bool, typer.Option("--json", help="print a JSON document")]


@app.command(
    context_settings={"ignore_unknown_options": True},
    no_args_is_help=True,
    epilog=f"Kinds: {', '.join(KINDS)}. What one wants: dcmg attack kinds KIND.",
)
def start(
    words: Annotated[
        list[str],
        typer.Argument(
            metavar="KIND LINK... [--PARAMETER VALUE...]...",
            help="kind of attack, the attacked links (from sender to receiver, as in 1-2), and its parameters",
            show_default=False,
        ),
    ],
    *,
    duration: Annotated[float, typer.Option(help="length [s]; 0: until stopped")] = 0.0,
    domain: Domain = None,
) -> None:
    """Start an attack of any kind, from the next sample on.

    Parameters stand behind the links, each with its value or values; a value may be JSON:

    dcmg attack start bias 1-2 --bias 0.1 0.1 0.1

    dcmg attack start zero_sum 1-2 5-4 --shares 0.5 -0.5 --duration 20

    dcmg attack start spoof 1-2 --falsify '{"kind": "scaling", "gain": [1, 0.9, 1]}'
    """
    order = parse_order(words)
    with attack_client(domain) as client:
        number, step = client.start(order.links, order.kind, order.parameters, duration)
    links = ", ".join(map(str, order.links))
    typer.echo(f"attack {number} ({order.kind}) acts on link {links} from step {step} on")


@app.command()
def stop(
    link: Annotated[str, typer.Argument(help="attacked link, as in 1-2", show_default=False)], *, domain: Domain = None
) -> None:
    """Stop all attacks on a link; one that acts on several links stops on all of them."""
    found = parse_link(link)
    with attack_client(domain) as client:
        count, step = client.stop(found)
    typer.echo(f"{count} attack(s) stopped: link {link} is clean from step {step} on")


@app.command("list")
def list_(*, domain: Domain = None, json: Json = False) -> None:
    """Show the active and scheduled attacks."""
    with attack_client(domain) as client:
        attacks = client.list()
    if json:
        typer.echo(json_module.dumps(attacks))
        return
    table = Table("attack", "link", "kind", "parameters", "from step", "until [s]", "state", "origin")
    for attack in attacks:
        until = "stopped by hand" if attack["stop_sec"] is None else f"{attack['stop_sec']:g}"
        state = "active" if attack["active"] else "scheduled"
        cells = (attack["attack"], attack["link"], attack["kind"], attack["parameters"], attack["start_step"])
        table.add_row(*(str(cell) for cell in cells), until, state, str(attack["origin"]))
    Console().print(table if attacks else "no attack is active or scheduled")


@app.command()
def kinds(
    kind: Annotated[str | None, typer.Argument(help="show this one with its parameters", show_default=False)] = None,
    *,
    json: Json = False,
) -> None:
    """Say what attacks there are; what one does, knows and wants."""
    chosen = KINDS if kind is None else {kind: known_kind(kind)}
    if json:
        document = {
            name: {"does": first_line(attack), "knows": attack.knows, "parameters": attack.model_json_schema()}
            for name, attack in chosen.items()
        }
        typer.echo(json_module.dumps(document))
        return
    if kind is None:
        table = Table("kind", "what it does", "what it must know")
        for name, attack in KINDS.items():
            table.add_row(name, first_line(attack), attack.knows)
        Console().print(table)
        return
    attack = chosen[kind]
    typer.echo(f"{kind}: {' '.join((attack.__doc__ or '').split())}\nThe attacker must know: {attack.knows}.")
    table = Table("parameter", "default", "meaning")
    for row in parameters_of(attack):
        table.add_row(*row)
    Console().print(table if attack.model_fields else "no parameters")
    typer.echo(f"dcmg attack start {kind} {EXAMPLES.get(kind, '1-2')}")
