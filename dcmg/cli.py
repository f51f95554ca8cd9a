"""The `dcmg` command: a table of commands (`dcmg.command_table`), each imported only when it is called."""

from __future__ import annotations

import io
import os
import sys
from typing import Annotated, Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # our matrices are small; a process with threads must not fork
if "_DCMG_COMPLETE" in os.environ:
    os.environ["TYPER_USE_RICH"] = "0"  # a shell waits for names, and rich takes longer than to find them

import typer

from bags.ros_words import split_words
from dcmg.command_table import COMMANDS
from dcmg.lazy import LazyGroup, commands_of
from dcmg.refusals import run_to_one_line

__all__ = ["app", "main"]


class _Door(LazyGroup):
    """All commands of the table, and those that other packages add."""

    def __init__(self, *arguments: Any, **settings: Any) -> None:  # noqa: ANN401 (typer's own are private)
        super().__init__(*arguments, **settings)
        self.commands.update(commands_of(COMMANDS))


app = typer.Typer(
    name="dcmg",
    cls=_Door,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="""Would an attack on a DC microgrid's communication be noticed?

Runs microgrid scenarios over ROS 2 (`run`) or without it (`simulate`), with an attacker on the communication links and
data-driven unknown-input observers watching; every run ends in a bag that `replay` evaluates again.

Start here: `dcmg scenarios`, then `dcmg run gallo_six_dgu`.""",
)


def _print_version(wanted: bool) -> None:  # noqa: FBT001 (typer passes the value of the option)
    if not wanted:
        return
    from importlib.metadata import version  # noqa: PLC0415 (takes its time)

    from engine import described  # noqa: PLC0415 (idem)

    typer.echo(f"dcmg {version('dcmg')} ({described()})")
    raise typer.Exit


@app.callback()
def options(
    *,
    _version: Annotated[
        bool, typer.Option("--version", help="print the version and end", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Take the options that stand before the command."""


def main() -> None:
    """Run the command; what it refuses becomes one line on standard error and exit code 2."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that has no arrow shows a question mark, not a traceback
    ours, _ = split_words(sys.argv[1:])  # the rest is for rclpy, which takes it from sys.argv
    sys.exit(run_to_one_line(lambda: app(ours, prog_name="dcmg", standalone_mode=False)))


if __name__ == "__main__":
    main()
