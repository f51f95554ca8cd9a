"""SIGINT and SIGTERM of a run: noted from before the first fork until the last process is gone, never raised.

A KeyboardInterrupt could hit between a fork and the line that notes the child, which then nobody ends; in a child while
it imports, where it can be swallowed; and in rclpy's C++, which makes another error of it.
"""

from __future__ import annotations

import signal
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def interruptions() -> Iterator[list[int]]:
    """Note the signals that come during the `with` block in a list."""
    told: list[int] = []
    before = {number: signal.signal(number, lambda number, _: told.append(number)) for number in _SIGNALS}
    try:
        yield told
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def held_back() -> Iterator[None]:
    """Let the signals wait for the end of the `with` block; a child that is forked in it starts with them waiting."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end_by_signals() -> None:
    """In a forked child: one that came or comes ends it, until it has a handler of its own."""
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _SIGNALS)
