"""What commands that read foreign bags have in common: definitions from elsewhere, and an exit code."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bags.sources.recorded import Known

EXIT_LEFT_OUT = 3  # all went well, but something could not be read, and was named


Definitions = Annotated[
    list[Path] | None,
    typer.Option(
        metavar="DIR",
        help="folder of .msg files for types that the bag does not define itself; repeatable",
        show_default=False,
    ),
]


def known_definitions(folders: Sequence[Path] | None) -> Known:
    """Definitions of `--definitions`, and where installed ROS packages are.

    Raises:
        BagError: a folder holds none.
    """
    from bags.mcap.definitions import types_in_folder  # noqa: PLC0415 (heavy)
    from bags.sources.recorded import Known  # noqa: PLC0415 (heavy)

    types: dict[str, Any] = {}
    for folder in folders or ():
        types |= types_in_folder(folder)
    prefixes = tuple(Path(one) for one in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if one)
    return Known(types=types, prefixes=prefixes)
