"""`dcmg host`: a machine that runs nodes for the command of another."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 (typer reads the annotations)
from typing import Annotated

import typer


def host(
    *,
    listen: Annotated[
        str, typer.Option(metavar="ADDRESS[:PORT]", help="where to wait; other machines need another address than this")
    ] = "127.0.0.1",
    secret_file: Annotated[
        Path | None,
        typer.Option(help="holds the shared secret; default: the variable DCMG_HOST_SECRET", show_default=False),
    ] = None,
    stdio: Annotated[
        bool, typer.Option("--stdio", help="serve one command over standard input and output: ssh")
    ] = False,
) -> None:
    """Wait on this machine for `dcmg run --hosts` of another, and run nodes for it.

    Whoever knows the shared secret can have nodes of a scenario run here, and nothing else; what they send is kept in
    memory and in a temporary folder that goes with this command. Ctrl-C ends it, and the nodes. For example, here and
    on the machine of the command with the same file: dcmg host --listen 192.168.7.2 --secret-file ~/.dcmg-secret
    """
    from dcmg_bringup.hosts.listening import listening_at, secret_key  # noqa: PLC0415 (heavy)
    from dcmg_bringup.hosts.waiting import serve_stdio, wait_at  # noqa: PLC0415 (heavy)

    if stdio:
        serve_stdio()
    else:
        wait_at(listening_at(listen), secret_key(secret_file))
