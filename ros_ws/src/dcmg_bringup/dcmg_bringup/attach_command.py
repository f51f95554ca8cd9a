"""`dcmg attach`: a shell, or one command, in the ROS domain of a running system."""

from __future__ import annotations

import os
import subprocess
from typing import Annotated

import typer

from dcmg.errors import CommandError
from dcmg_bringup.attack_client import find_system
from dcmg_bringup.ros_environment import ros_environment

attach_app = typer.Typer(add_completion=False, rich_markup_mode="markdown")


@attach_app.command(context_settings={"ignore_unknown_options": True})
def attach(
    command: Annotated[
        list[str] | None, typer.Argument(metavar="[COMMAND]...", help="what to run there; default: a shell")
    ] = None,
    *,
    domain: Annotated[
        int | None, typer.Option(help="ROS domain id of the system; default: the only one running", show_default=False)
    ] = None,
) -> None:
    """Open a shell in which ROS programs find the running system: `ros2 topic list`, or a node of your own.

    The same by hand: `export ROS_DOMAIN_ID=…`, as `dcmg run` says when it starts. docs/own_node.md shows nodes that
    listen to a run and that take part in it.
    """
    system = find_system(domain)
    what = f" ({system.scenario})" if system.scenario else ""
    typer.echo(f"ROS domain {system.domain}{what}; leave with exit", err=True)
    words = command or [os.environ.get("SHELL") or "/bin/sh"]
    try:
        done = subprocess.run(words, env={**os.environ, **ros_environment(system.domain)}, check=False)  # noqa: S603 (theirs)
    except OSError as error:
        raise CommandError(f"{words[0]}: cannot be started ({error.strerror})") from error
    raise typer.Exit(done.returncode)
