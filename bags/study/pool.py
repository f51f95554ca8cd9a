"""Who computes the cells of a study: a process for each on this machine; `cluster` has the other one."""

import multiprocessing
import os
import pickle
import signal
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Protocol

from bags.orphans import die_with, is_stopped
from bags.study.cells import StudyCell
from bags.study.errors import StudyError
from bags.study.evaluate import evaluate
from bags.study.parts import Parts, as_part
from monitor.errors import MonitorError

MOST_LOST = 3
"""So often a cell is tried again when its process dies; one that always dies is too large for the machine."""
_LOOK_SEC = 0.5
_STOPPED_LOOKS = 6  # a process stopped for so many looks does not go on by itself


class Pool(Protocol):
    """Computes cells."""

    def compute(self, cells: Sequence[StudyCell], parts: Parts, say: Callable[[str], object]) -> Iterator[StudyCell]:
        """Yield each cell once it is kept among the parts, in the order in which they are finished.

        Raises:
            StudyError: A cell fails, whoever computes it.
        """


@dataclass(frozen=True, slots=True)
class LocalPool:
    """A process for each cell, so many at a time: one that is killed or stopped costs the work on its cell.

    Attributes:
        workers: How many at a time.
    """

    workers: int = 1

    def compute(self, cells: Sequence[StudyCell], parts: Parts, say: Callable[[str], object]) -> Iterator[StudyCell]:
        """See `Pool`."""
        waiting, lost, working = deque(cells), Counter[str](), dict[Connection, _Working]()
        try:
            while waiting or working:
                while waiting and len(working) < self.workers:
                    cell = waiting.popleft()
                    listening, process = _started(cell, parts)
                    working[listening] = _Working(cell=cell, process=process)
                for listening in _answering(working):
                    done = working.pop(listening)
                    if _is_done(listening, done):
                        yield done.cell
                        continue
                    lost[done.cell.key] += 1
                    check_lost(done.cell, lost[done.cell.key])
                    say(f"{named(done.cell)}: its process was killed: computed again")
                    waiting.appendleft(done.cell)
        finally:
            for left in working.values():
                left.process.kill()  # half a part is never taken for one; who is stopped takes no other signal
                left.process.join()


def named(cell: StudyCell) -> str:
    """What to call a cell in messages."""
    return f"study {cell.study}: condition {cell.condition}, observer {cell.observer.name}"


def check_lost(cell: StudyCell, times: int) -> None:
    """Give a cell up whose process died too often.

    Raises:
        StudyError: It did.
    """
    if times > MOST_LOST:
        raise StudyError(
            f"{named(cell)}: the process with its seeds {cell.seeds[0]} to {cell.seeds[-1]} was killed {times} times, "
            "expected enough memory for one cell: start again to go on"
        )


@dataclass(slots=True, kw_only=True)
class _Working:
    cell: StudyCell
    process: BaseProcess
    stopped: int = 0


def _started(cell: StudyCell, parts: Parts) -> tuple[Connection, BaseProcess]:
    """Fork: everything is imported, and what a cell takes of memory goes with its process."""
    context = multiprocessing.get_context("fork")
    listening, telling = context.Pipe(duplex=False)
    process = context.Process(target=_work, args=(cell, parts, telling, os.getpid()))
    process.start()
    telling.close()  # the only other end is the child's: it closes when the child is gone
    return listening, process


def _work(cell: StudyCell, parts: Parts, telling: Connection, parent: int) -> None:
    """Ctrl-C reaches the whole foreground group: the parent alone decides what it means; nobody outlives it."""
    die_with(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        parts.write(cell.key, as_part(cell.key, evaluate(cell)))
        telling.send_bytes(pickle.dumps(None))
    except (MonitorError, OSError) as error:
        telling.send_bytes(pickle.dumps(error))


def _answering(working: dict[Connection, _Working]) -> list[Connection]:
    """Those who said something or are gone; a process that stays stopped by a signal is made to go."""
    found = [one for one in wait(list(working), timeout=_LOOK_SEC) if isinstance(one, Connection)]
    for one in working.values():
        one.stopped = one.stopped + 1 if is_stopped(one.process.pid) else 0
        if one.stopped > _STOPPED_LOOKS:
            one.process.kill()
    return found


def _is_done(listening: Connection, done: _Working) -> bool:
    """Whether the process did its work; False: it is gone.

    Raises:
        StudyError: It could not do it.
    """
    try:
        said = pickle.loads(listening.recv_bytes())  # noqa: S301 - of our own child
    except (EOFError, OSError):
        return False
    finally:
        listening.close()
        done.process.join()
    if isinstance(said, OSError):
        raise said
    if isinstance(said, MonitorError):
        raise StudyError(f"{named(done.cell)}: {said}") from said
    return True
