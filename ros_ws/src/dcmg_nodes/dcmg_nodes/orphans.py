"""No node outlives the command that started it."""

from __future__ import annotations

import ctypes
import os
import signal

_PR_SET_PDEATHSIG = 1
_EXIT_ORPHANED = 1


def die_with(parent: int) -> None:
    """Be interrupted when the process that started this one dies, however and whenever it dies.

    Args:
        parent: its process id; when it is not the parent any more, this process ends at once.
    """
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGINT)
    if os.getppid() != parent:  # it died before the line above: no signal will come
        os._exit(_EXIT_ORPHANED)
