"""The process that ends what a killed supervisor left behind.

The kernel tells nodes of their supervisor's death (`bags.orphans`), but the recorder must have time to close its bag,
and a process that is stopped takes no signal but SIGKILL. So a small process of its own waits for the end of a pipe
that the supervisor alone holds open, gives what is left a moment, and kills it.
"""

from __future__ import annotations

import os
import select
import signal

_GRACE_SEC = 5.0
_NUMBER_BYTES = 4


class Reaper:
    """Owned by the supervisor; it must be started before the processes that it looks after."""

    def __init__(self) -> None:
        """Fork the reaper."""
        read_end, self._write_end = os.pipe()
        self._pid = os.fork()
        if self._pid == 0:
            try:
                os.close(self._write_end)
                os.setsid()
                for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
                    signal.signal(number, signal.SIG_IGN)
                _reap(read_end)
            finally:
                os._exit(0)
        os.close(read_end)

    def look_after(self, pid: int) -> None:
        """End this child of the supervisor if the supervisor dies."""
        os.write(self._write_end, pid.to_bytes(_NUMBER_BYTES, "little"))

    def forget(self) -> None:
        """Close the pipe in a forked child: only the supervisor's end counts."""
        os.close(self._write_end)

    def dismiss(self) -> None:
        """End the reaper, once every process has ended."""
        os.close(self._write_end)
        os.waitpid(self._pid, 0)


def _reap(read_end: int) -> None:
    """Learn the process ids until the pipe ends, then interrupt, wait, and kill."""
    processes = []
    while number := os.read(read_end, _NUMBER_BYTES):
        try:
            processes.append(os.pidfd_open(int.from_bytes(number, "little")))
        except ProcessLookupError:
            continue
    for step, grace_sec in ((signal.SIGINT, _GRACE_SEC), (signal.SIGKILL, 0.0)):
        for process in processes:
            for sent in (step, signal.SIGCONT):
                _send(process, sent)
        left = list(processes)
        while left and grace_sec:
            ended, _, _ = select.select(left, (), (), grace_sec)
            if not ended:
                break
            left = [process for process in left if process not in ended]
        processes = left


def _send(process: int, number: signal.Signals) -> None:
    try:
        signal.pidfd_send_signal(process, number)
    except ProcessLookupError:
        return  # it has ended
