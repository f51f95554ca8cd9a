"""What the nodes refuse, as the command says it."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from dcmg.errors import CommandError
from dcmg_nodes.errors import NodeError

if TYPE_CHECKING:
    from collections.abc import Iterator


@contextmanager
def said_in_one_line() -> Iterator[None]:
    """Let the command end in the line of a NodeError.

    Raises:
        CommandError: what the nodes refused.
    """
    try:
        yield
    except NodeError as error:
        raise CommandError(str(error)) from error
