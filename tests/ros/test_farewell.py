"""A process that hangs in C with the GIL held ends in time, with the exit code that it earned."""

from __future__ import annotations

import subprocess
import sys

import pytest

HELD_UP = """
import ctypes
from dcmg_nodes.farewell import ends_within
with ends_within(1, {code}):
    ctypes.PyDLL(None).pause()  # holds the GIL for ever, as rclpy does while it destroys a node
"""
QUICK = """
import time
from dcmg_nodes.farewell import ends_within
with ends_within(1, 7):
    pass
time.sleep(1.5)  # longer than the timer would have run
"""


@pytest.mark.parametrize("code", [0, 1, 7])
def test_what_holds_it_up_does_not_matter(code: int) -> None:
    """Neither the lock of the interpreter nor a signal handler is needed."""
    done = subprocess.run([sys.executable, "-c", HELD_UP.format(code=code)], timeout=60, check=False)
    assert done.returncode == code


def test_who_leaves_in_time_lives_on() -> None:
    """The timer is gone with the block."""
    assert subprocess.run([sys.executable, "-c", QUICK], timeout=60, check=False).returncode == 0
