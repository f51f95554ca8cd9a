"""Single keys from a terminal, without waiting for them."""

from __future__ import annotations

import os
import select
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

SPACE, RIGHT, UP, DOWN = " ", "\x1b[C", "\x1b[A", "\x1b[B"
_AT_ONCE = 64


@contextmanager
def keys() -> Iterator[Callable[[], list[str]]]:
    """Give a function that returns the keys pressed since its last call: none where standard input is no terminal."""
    if not sys.stdin.isatty():
        yield list
        return
    import termios  # noqa: PLC0415 (only where there is a terminal)
    import tty  # noqa: PLC0415

    handle = sys.stdin.fileno()
    before = termios.tcgetattr(handle)
    tty.setcbreak(handle)
    try:
        yield lambda: _pressed(handle)
    finally:
        termios.tcsetattr(handle, termios.TCSADRAIN, before)


def _pressed(handle: int) -> list[str]:
    found = ""
    while select.select([handle], [], [], 0.0)[0]:
        text = os.read(handle, _AT_ONCE).decode(errors="ignore")
        if not text:
            break
        found += text
    return split_keys(found)


def split_keys(text: str) -> list[str]:
    """Cut what a terminal sent into keys: a letter, or an escape sequence of three."""
    found = []
    while text:
        length = len(RIGHT) if text.startswith("\x1b[") else 1
        found.append(text[:length])
        text = text[length:]
    return found
