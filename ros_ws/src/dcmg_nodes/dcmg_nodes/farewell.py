"""A process that cannot leave DDS ends all the same, with the exit code that it earned.

Fast DDS 2.14 can lock up for ever while a participant is destroyed: `DomainParticipant::set_listener` spins with the
lock that a discovery callback waits for, when a peer comes or goes at that instant. rclpy holds the GIL meanwhile, so
that no Python thread and no Python signal handler runs; a timer of the C library does.
"""

from __future__ import annotations

import ctypes
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rclpy.node import Node

_LEAVES_SEC = 3
_CLOCK_MONOTONIC, _SIGEV_THREAD = 1, 2


class _Event(ctypes.Structure):
    """struct sigevent of glibc: a new thread calls `function` with `value`."""

    _fields_ = (
        ("value", ctypes.c_void_p),
        ("signo", ctypes.c_int),
        ("notify", ctypes.c_int),
        ("function", ctypes.c_void_p),
        ("attributes", ctypes.c_void_p),
        ("rest", ctypes.c_char * 32),
    )


class _Times(ctypes.Structure):
    """struct itimerspec: interval and first expiry, seconds and nanoseconds."""

    _fields_ = tuple((name, ctypes.c_long) for name in ("interval_sec", "interval_ns", "first_sec", "first_ns"))


@contextmanager
def ends_within(seconds: int, code: int) -> Iterator[None]:
    """End the process with an exit code if the `with` block takes longer, whatever holds it up."""
    libc, timer = _library(), ctypes.c_void_p()
    if libc is None:
        yield
        return
    leave = ctypes.cast(libc._exit, ctypes.c_void_p).value  # noqa: SLF001 - the C function of that name
    event = _Event(value=code, notify=_SIGEV_THREAD, function=leave)
    armed = libc.timer_create(_CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)) == 0
    if armed:
        libc.timer_settime(timer, 0, ctypes.byref(_Times(first_sec=seconds)), None)
    try:
        yield
    finally:
        if armed:
            libc.timer_delete(timer)


def _library() -> ctypes.CDLL | None:
    """What has the timers: glibc itself, or a library beside it before 2.34; None where there is neither."""
    for name in (None, "librt.so.1"):
        with suppress(OSError):
            library = ctypes.CDLL(name)
            if hasattr(library, "timer_create") and hasattr(library, "_exit"):
                return library
    return None


def destroy(node: Node, code: int) -> None:
    """Destroy a node; if that does not come to its end, end the process with an exit code."""
    with ends_within(_LEAVES_SEC, code):
        node.destroy_node()
