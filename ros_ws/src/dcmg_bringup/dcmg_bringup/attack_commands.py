"""`dcmg attack`: start, stop and list attacks in a running system."""

from __future__ import annotations

import json as json_module
import re
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from dcmg_bringup.attack_client import AttackClientError, attack_client

app = typer.Typer(no_args_is_help=True, help="Start, stop and list attacks in a running system.")

LinkOption = Annotated[str, typer.Option(help="link from the sending to the receiving DGU, as in 1-2")]
Domain = Annotated[
    int | None, typer.Option(help="ROS domain id of the system; default: the only one running", show_default=False)
]


@app.command(context_settings={"ignore_unknown_options": True})
def start(
    link: LinkOption,
    bias: Annotated[
        tuple[float, float, float], typer.Option(metavar="V A VS", help="added to V [V], I_t [A], v [V s]")
    ],
    *,
    duration: Annotated[float, typer.Option(help="length [s]; 0: until stopped")] = 0.0,
    domain: Domain = None,
) -> None:
    """Add a bias to what a link delivers, from the next sample on."""
    with attack_client(domain) as client:
        number, step = client.start(_link(link), "bias", {"bias": list(bias)}, duration)
    typer.echo(f"attack {number} acts on link {link} from step {step} on")


@app.command()
def stop(link: LinkOption, *, domain: Domain = None) -> None:
    """Stop all attacks on a link."""
    with attack_client(domain) as client:
        count, step = client.stop(_link(link))
    typer.echo(f"{count} attack(s) stopped: link {link} is clean from step {step} on")


@app.command("list")
def list_(
    *, domain: Domain = None, json: Annotated[bool, typer.Option("--json", help="print a JSON document")] = False
) -> None:
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


def _link(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d+)-(\d+)", text)
    if match is None:
        raise AttackClientError(f"--link {text}: expected two DGU numbers, as in 1-2")
    return int(match[1]), int(match[2])
