"""Run the cells of a study in parallel; finished ones are kept, so an interrupted study goes on where it was."""

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import pyarrow as pa
from pyarrow import parquet

from bags.orphans import die_with, is_stopped
from bags.study.cells import StudyCell
from bags.study.errors import StudyError
from bags.study.evaluate import SCHEMA, evaluate
from bags.study.parts import Parts, write_whole
from monitor.errors import MonitorError

TABLE = "table.parquet"
_PARTS = "parts"
_LOOK_SEC = 0.5
_STOPPED_LOOKS = 6  # a process stopped for so many looks does not go on by itself


def run_study(
    cells: Sequence[StudyCell],
    out: Path,
    workers: int,
    progress: Callable[[int, int], None] | None = None,
    say: Callable[[str], None] | None = None,
) -> Path:
    """Run what is missing and write the table of all cells.

    Each cell's rows stand in a file of their own below `out/parts`, named by a digest of all they follow from, and get
    there in one move: a study that is interrupted or killed at any moment loses the cells in work and nothing else. A
    part that does not agree with its check sum or its cell is computed again.

    Args:
        cells: The study.
        out: Its folder.
        workers: Processes that work at a time.
        progress: Called with the number of cells that are done and the number of all.
        say: Called with a line for each part that is computed again.

    Returns:
        Path of the table, columns as in `evaluate.SCHEMA`, rows in the order of the cells.

    Raises:
        StudyError: A cell fails, its process is stopped, or the folder cannot be written.
    """
    path = out / TABLE
    try:
        parts = Parts(out / _PARTS, SCHEMA)
        if path.is_dir():
            raise StudyError(f"{path}: is a folder, expected the place of a file to be written")
        kept = {cell.key: parts.read(cell.key) for cell in cells}
        for key, found in kept.items():
            if isinstance(found, str) and say is not None:
                say(f"{parts.path(key)}: {found}: computed again")
        missing = [cell for cell in cells if not isinstance(kept[cell.key], pa.Table)]
        done = len(cells) - len(missing)
        _run_all(missing, parts, workers, lambda more: progress and progress(done + more, len(cells)))
        kept |= {cell.key: parts.read(cell.key) for cell in missing}
        for key, found in kept.items():
            if not isinstance(found, pa.Table):
                raise StudyError(f"{parts.path(key)}: {found or 'is gone'}, though just written: start again to go on")
        target = pa.BufferOutputStream()
        parquet.write_table(pa.concat_tables([kept[cell.key] for cell in cells]), target, compression="zstd")
        write_whole(target.getvalue().to_pybytes(), path)
    except (OSError, pa.ArrowException) as error:
        raise StudyError(f"{out}: expected a folder that can be written and read: {error}") from error
    return path


def _run_all(cells: Sequence[StudyCell], parts: Parts, workers: int, done: Callable[[int], object]) -> None:
    done(0)
    if not cells:
        return
    context = multiprocessing.get_context("fork")  # everything is imported; nothing here has threads yet
    count = min(workers, len(cells))
    with ProcessPoolExecutor(count, mp_context=context, initializer=_begin, initargs=(os.getpid(),)) as pool:
        futures = {pool.submit(_work, cell, parts): cell for cell in cells}
        try:
            for number, future in enumerate(_completed(futures), start=1):
                cell = futures[future]
                where = f"study {cell.study}: condition {cell.condition}, observer {cell.observer.name}"
                try:
                    future.result()
                except MonitorError as error:
                    raise StudyError(f"{where}: {error}") from error
                except BrokenProcessPool as error:
                    raise StudyError(f"{where}: its process was killed: start again to go on") from error
                done(number)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in multiprocessing.active_children():
                process.kill()  # half a part is never taken for one; a process that is stopped takes no other signal
            raise


def _completed(futures: Iterable[Future[None]]) -> Iterator[Future[None]]:
    """Futures as they are done.

    Raises:
        StudyError: A process that works on them is stopped by a signal and does not go on.
    """
    pending, looks = set(futures), 0
    while pending:
        done, pending = wait(pending, timeout=_LOOK_SEC, return_when=FIRST_COMPLETED)
        yield from done
        stopped = [child.pid for child in multiprocessing.active_children() if is_stopped(child.pid)]
        looks = looks + 1 if stopped and not done else 0
        if looks > _STOPPED_LOOKS:
            raise StudyError(f"process {stopped[0]} of the study is stopped by a signal: start again to go on")


def _work(cell: StudyCell, parts: Parts) -> None:
    parts.write(cell.key, evaluate(cell))


def _begin(parent: int) -> None:
    """Ctrl-C reaches the whole foreground group: the parent alone decides what it means; nobody outlives it."""
    die_with(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
