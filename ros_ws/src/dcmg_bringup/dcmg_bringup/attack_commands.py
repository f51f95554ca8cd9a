"""`dcmg attack`: start, stop and list attacks in a running system."""

from __future__ import annotations

import json as json_module
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from dcmg.attack_words import parse_link, parse_order
from dcmg.tabular import tabulate
from dcmg_bringup.attack_client import attack_client
from dgu_sim.attacks import KINDS
from dgu_sim.attacks.wording import parameter_words

if TYPE_CHECKING:
    from collections.abc import Mapping

start_app = typer.Typer(add_completion=False, rich_markup_mode="markdown")

Domain = Annotated[
    int | None, typer.Option(help="ROS domain id of the system; default: the only one running", show_default=False)
]
Json = Annotated[bool, typer.Option("--json", help="print a JSON document")]


@start_app.command(
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
    anyway: Annotated[
        bool, typer.Option("--anyway", help="start though the detectors still learn: they take the attack for normal")
    ] = False,
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
        number, step = client.start(
            order.links, order.kind, {**order.parameters, **({"anyway": True} if anyway else {})}, duration
        )
    links = ", ".join(map(str, order.links))
    typer.echo(f"attack {number} ({order.kind}) acts on link {links} from step {step} on")


def stop(
    link: Annotated[str, typer.Argument(help="attacked link, as in 1-2", show_default=False)], *, domain: Domain = None
) -> None:
    """Stop all attacks on a link; one that acts on several links stops on all of them."""
    found = parse_link(link)
    with attack_client(domain) as client:
        count, step = client.stop(found)
    typer.echo(f"{count} attack(s) stopped: link {link} is clean from step {step} on")


def list_(*, domain: Domain = None, json: Json = False) -> None:
    """Show the active and scheduled attacks."""
    with attack_client(domain) as client:
        attacks = client.list()
    if json:
        typer.echo(json_module.dumps(attacks))
        return
    if not attacks:
        typer.echo("no attack is active or scheduled")
        return
    headings = ("attack", "link", "kind", "parameters", "from [s]", "until [s]", "state", "by")
    rows = [_row(attack) for attack in attacks]
    Console().print(tabulate(headings, rows, numbers={"attack", "from [s]"}))


def _row(attack: Mapping[str, Any]) -> tuple[str, ...]:
    """An attack as the cells of the list: its parameters one a line, times in seconds."""
    parameters = "\n".join(parameter_words(attack["parameters"]))
    until = "stopped" if attack["stop_sec"] is None else f"{attack['stop_sec']:g}"
    state = "active" if attack["active"] else "scheduled"
    start = f"{attack['start_sec']:g}"
    return (str(attack["attack"]), attack["link"], attack["kind"], parameters, start, until, state, attack["origin"])
