"""No process outlives the command that started it."""

import ctypes
import os
import signal
from pathlib import Path

_PR_SET_PDEATHSIG = 1
_EXIT_ORPHANED = 1
_STOPPED = "T"


def die_with(parent: int, number: signal.Signals = signal.SIGKILL) -> None:
    """Get a signal from the kernel when the process that started this one dies, however and whenever it dies.

    A shell starts background jobs with SIGINT ignored, and children inherit that: so a signal other than SIGKILL gets
    its default action back here, until the process has a handler of its own.

    Args:
        parent: Its process id; when it is not the parent any more, this process ends at once.
        number: The signal; all but SIGKILL can be missed by a process that is stopped.
    """
    if number is not signal.SIGKILL:
        signal.signal(number, signal.SIG_DFL)
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, number)
    if os.getppid() != parent:  # it died before the line above: no signal will come
        os._exit(_EXIT_ORPHANED)


def is_stopped(pid: int | None) -> bool:
    """Tell whether a signal has stopped a process (SIGSTOP, SIGTSTP)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == _STOPPED
    except (OSError, IndexError):
        return False  # it is gone
