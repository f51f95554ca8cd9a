"""`dcmg player`: steer a replay that publishes, from another terminal."""

from __future__ import annotations

import math
from contextlib import closing
from typing import TYPE_CHECKING, Annotated

import typer

from dcmg.errors import CommandError
from dcmg_bringup.domain import REPLAY, checked_domain, running_systems
from dcmg_bringup.service_client import ServiceClient

if TYPE_CHECKING:
    from dcmg_msgs.srv import ControlReplay

app = typer.Typer(no_args_is_help=True, help="Steer a replay that publishes (`dcmg replay --publish`).")

Domain = Annotated[
    int | None, typer.Option(help="ROS domain id of the replay; default: the only one running", show_default=False)
]


@app.command()
def pause(*, domain: Domain = None) -> None:
    """Stand still."""
    _show(_call(domain, "PAUSE"))


@app.command()
def resume(*, domain: Domain = None) -> None:
    """Go on."""
    _show(_call(domain, "RESUME"))


@app.command()
def step(
    steps: Annotated[int, typer.Argument(min=1, help="how many stamps (in a run: steps) to go on")] = 1,
    *,
    domain: Domain = None,
) -> None:
    """Publish the messages of the next stamps, then stand still."""
    _show(_call(domain, "STEP", steps=steps))


@app.command()
def rate(
    factor: Annotated[str, typer.Argument(metavar="FACTOR|max", help="of real time")], *, domain: Domain = None
) -> None:
    """Go faster or slower."""
    try:
        wanted = math.inf if factor == "max" else float(factor)
    except ValueError:
        raise CommandError(f"rate {factor}: expected a number or max") from None
    _show(_call(domain, "RATE", rate=wanted))


@app.command()
def status(*, domain: Domain = None) -> None:
    """Say how far the replay is."""
    _show(_call(domain, "STATUS"))


@app.command()
def stop(*, domain: Domain = None) -> None:
    """End the replay."""
    _show(_call(domain, "STOP"))


def _show(answer: ControlReplay.Response) -> None:
    how = "paused" if answer.paused else "as fast as it goes" if math.isinf(answer.rate) else f"rate {answer.rate:g}"
    typer.echo(f"t = {answer.time_sec:g} s, {answer.messages} messages, {how}")


def _call(domain: int | None, command: str, *, steps: int = 0, rate: float = 0.0) -> ControlReplay.Response:
    """Ask the player's service.

    Raises:
        CommandError: no replay, no answer, or refused.
    """
    domain = checked_domain(domain)
    domain = _only_domain() if domain is None else domain
    with closing(ServiceClient({"ROS_DOMAIN_ID": str(domain)}, "replay", "is one publishing there?", 10.0)) as client:
        from dcmg_msgs.srv import ControlReplay  # noqa: PLC0415 (in the domain just joined)

        request = ControlReplay.Request(command=getattr(ControlReplay.Request, command), steps=steps, rate=rate)
        answer: ControlReplay.Response = client.call(ControlReplay, "/player/control", request)
    return answer


def _only_domain() -> int:
    """ROS domain id of the only replay on this machine."""
    replays = [system for system in running_systems() if system.scenario.startswith(REPLAY)]
    if len(replays) != 1:
        found = ", ".join(f"{system.domain} ({system.scenario})" for system in replays) or "none"
        raise CommandError(f"--domain: expected one, because the replays on this machine are: {found}")
    return replays[0].domain
