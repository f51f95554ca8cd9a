"""The end of a command that refuses: one line on standard error, and an exit code that says so."""

from __future__ import annotations

import os
import re
import sys
from typing import TYPE_CHECKING

import typer
from typer.exceptions import TyperException

from bags.ros_words import RosWordsError
from dcmg.errors import CommandError
from dgu_sim.suggestions import meant

if TYPE_CHECKING:
    from collections.abc import Callable

_CHOICE = re.compile("'([^']*)' is not one of (.*)")
_QUOTED = re.compile("'([^']*)'")

EXIT_REFUSED = 2
_EXIT_FAILED = 1


def run_to_one_line(command: Callable[[], object]) -> int:
    """Run a command and return its exit code; what it refuses is said in one line on standard error.

    An error that nobody foresaw is raised: it is ours, and its traceback is what we need.
    """
    try:
        result = command()
        sys.stdout.flush()
    except typer.Abort:
        return _EXIT_FAILED
    except Exception as error:
        line = _line(error)
        if line is None:
            raise
        if isinstance(error, OSError):
            _drop_output()
        if line:
            sys.stderr.write(f"dcmg: {line}\n")
        return EXIT_REFUSED
    return result if isinstance(result, int) else 0


def _drop_output() -> None:
    """Let what is still to be written go nowhere, if it can go nowhere else: Python would fail on it once more."""
    try:
        sys.stdout.flush()
    except OSError:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


def _line(error: Exception) -> str | None:
    """What is said of an error; empty when it has said everything itself, None when it is unforeseen."""
    if isinstance(error, TyperException):
        return _usage(error)
    if isinstance(error, OSError):
        return _of_system(error)
    if isinstance(error, MemoryError):
        return f"not enough memory ({error})" if str(error) else "not enough memory"
    if isinstance(error, RosWordsError):
        return str(error)
    from bags.mcap.errors import BagError  # noqa: PLC0415 (only a command that refuses needs the classes)
    from dgu_sim.errors import DguSimError  # noqa: PLC0415 (idem)
    from engine import EngineError  # noqa: PLC0415 (idem)
    from monitor.errors import MonitorError  # noqa: PLC0415 (idem)

    return str(error) if isinstance(error, (BagError, CommandError, DguSimError, EngineError, MonitorError)) else None


def _usage(error: TyperException) -> str:
    if type(error).__name__ == "NoArgsIsHelpError":  # its help is printed already, and the class is private
        return ""
    context = getattr(error, "ctx", None)
    command = "dcmg" if context is None else context.command_path
    message = " ".join(error.format_message().split()).replace(": Value error, ", ": ")
    choice = _CHOICE.search(message)
    near = meant(choice[1], _QUOTED.findall(choice[2])) if choice else ""
    return f"{message}{' ' + near[0].upper() + near[1:] if near else ''} (see `{command} --help`)"


def _of_system(error: OSError) -> str:
    reason = error.strerror or str(error)
    return f"{error.filename}: {reason}" if error.filename else reason
