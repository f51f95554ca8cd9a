"""Commands that are listed by their help line and imported only when somebody calls them."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from dcmg.joined import joined

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

__all__ = ["Command", "Group", "LazyGroup", "commands_of"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """One command.

    Attributes:
        name: what is typed.
        does: its line in the list of commands.
        target: "module:attribute", a function or a `typer.Typer`; None: another package brings it, by an entry point of
            group `dcmg.commands` (`dcmg.joined`).
        entry: name of that entry point.
        panel: heading it stands under.
    """

    name: str
    does: str
    target: str | None = None
    entry: str = ""
    panel: str = "Commands"


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """A command with commands of its own.

    Attributes:
        name: what is typed.
        does: its line in the list of commands.
        commands: what can be typed behind it.
        panel: heading it stands under.
    """

    name: str
    does: str
    commands: Sequence[Command]
    panel: str = "Commands"


class LazyGroup(TyperGroup):
    """A group that needs nothing but its own list to show it or to complete a word."""

    def get_params(self, *arguments: Any) -> list[Any]:  # noqa: ANN401 (typer's own are private)
        """Return the options, with False for a flag that is not given: None would need pydantic, slow to import."""
        found: list[Any] = super().get_params(*arguments)
        for option in found:
            if option.default is None and getattr(option, "is_flag", False):
                option.default = False
        return found


class _Later(TyperCommand):
    """Stands for a command until its arguments are to be read."""

    def __init__(self, command: Command) -> None:
        super().__init__(
            command.name, help=command.does, rich_markup_mode="markdown", rich_help_panel=command.panel, params=[]
        )
        self._command = command

    def make_context(self, *arguments: Any, **settings: Any) -> Any:  # noqa: ANN401 (typer's own are private)
        """Import the command and let it read its arguments."""
        return _imported(self._command).make_context(*arguments, **settings)


def commands_of(table: Sequence[Command | Group]) -> Mapping[str, Any]:
    """Return what typer lists and calls: name → command."""
    return {one.name: _Later(one) if isinstance(one, Command) else _group(one) for one in table}


def _group(group: Group) -> LazyGroup:
    return LazyGroup(
        name=group.name,
        help=group.does,
        rich_markup_mode="markdown",
        rich_help_panel=group.panel,
        no_args_is_help=True,
        commands=dict(commands_of(group.commands)),
    )


def _imported(command: Command) -> Any:  # noqa: ANN401 (typer's own are private)
    if command.target is None:
        found = joined(command.entry or command.name, f"dcmg {command.entry.replace('.', ' ') or command.name}")
    else:
        module, _, attribute = command.target.partition(":")
        found = getattr(importlib.import_module(module), attribute)
    if not isinstance(found, typer.Typer):
        alone = typer.Typer(add_completion=False, rich_markup_mode="markdown", pretty_exceptions_enable=False)
        alone.command(command.name)(found)
        found = alone
    made = get_command(found)
    made.name = command.name
    return made
