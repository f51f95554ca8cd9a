"""What other packages bring to the `dcmg` command, by entry points of the group `dcmg.commands`.

`dcmg_bringup` brings everything that needs ROS 2. Where ROS is missing, whoever calls it is told in one line.
"""

from __future__ import annotations

from typing import Any

from dcmg.errors import CommandError

__all__ = ["joined"]

_GROUP = "dcmg.commands"
_ROS_MODULES = ("rclpy", "dcmg_msgs", "dcmg_nodes", "dcmg_bringup")
_REMEDY = "`make install` in the repository sets up ROS 2 and these (docs/install.md)"


def joined(name: str, what: str) -> Any:  # noqa: ANN401 (a function or a typer application)
    """Import what an entry point names.

    Args:
        name: of the entry point; a dot stands between the words of a command.
        what: what needs it, for the message.

    Raises:
        CommandError: no installed package brings it, or what that package needs is missing.
    """
    from importlib import metadata, util  # noqa: PLC0415 (takes its time, and most commands ask for nothing)

    found = metadata.entry_points(group=_GROUP, name=name)
    missing = [module for module in _ROS_MODULES if util.find_spec(module) is None]
    if not found or missing:
        lacking = ", ".join(missing) or f"an entry point {name} of {_GROUP}"
        raise CommandError(f"{what} needs ROS 2, and {lacking} is not installed: {_REMEDY}")
    try:
        return next(iter(found)).load()
    except ImportError as error:
        raise CommandError(f"{what} needs ROS 2, which cannot be imported here ({error}): {_REMEDY}") from error
