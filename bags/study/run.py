"""Run the cells of a study in parallel; finished ones are kept, so an interrupted study goes on where it was."""

import multiprocessing
import os
import signal
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import pyarrow as pa
from pyarrow import parquet

from bags.orphans import die_with
from bags.study.cells import StudyCell
from bags.study.errors import StudyError
from bags.study.evaluate import SCHEMA, evaluate
from monitor.errors import MonitorError

TABLE = "table.parquet"
_PARTS = "parts"


def run_study(
    cells: Sequence[StudyCell], out: Path, workers: int, progress: Callable[[int, int], None] | None = None
) -> Path:
    """Run what is missing and write the table of all cells.

    Each cell's rows stand in a file of their own below `out/parts`, named by a digest of all they follow from, and get
    there in one move: a study that is interrupted or killed at any moment loses the cells in work and nothing else.

    Args:
        cells: The study.
        out: Its folder.
        workers: Processes that work at a time.
        progress: Called with the number of cells that are done and the number of all.

    Returns:
        Path of the table, columns as in `evaluate.SCHEMA`, rows in the order of the cells.

    Raises:
        StudyError: A cell fails, or the folder cannot be written.
    """
    parts = {cell.key: out / _PARTS / f"{cell.key}.parquet" for cell in cells}
    try:
        (out / _PARTS).mkdir(parents=True, exist_ok=True)
        missing = [cell for cell in cells if not parts[cell.key].exists()]
        kept = len(cells) - len(missing)
        _run_all(missing, parts, workers, lambda done: progress and progress(kept + done, len(cells)))
        table = pa.concat_tables([parquet.read_table(parts[cell.key], schema=SCHEMA) for cell in cells])
        _write(table, out / TABLE)
    except (OSError, pa.ArrowException) as error:
        raise StudyError(f"{out}: expected a folder that can be written and read: {error}") from error
    return out / TABLE


def _run_all(cells: Sequence[StudyCell], parts: dict[str, Path], workers: int, done: Callable[[int], object]) -> None:
    done(0)
    if not cells:
        return
    context = multiprocessing.get_context("fork")  # everything is imported; nothing here has threads yet
    count = min(workers, len(cells))
    with ProcessPoolExecutor(count, mp_context=context, initializer=_begin, initargs=(os.getpid(),)) as pool:
        futures = {pool.submit(_work, cell, parts[cell.key]): cell for cell in cells}
        try:
            for number, future in enumerate(as_completed(futures), start=1):
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
                process.terminate()
            raise


def _work(cell: StudyCell, path: Path) -> None:
    _write(evaluate(cell), path)


def _write(table: pa.Table, path: Path) -> None:
    """Write a file that is there as a whole or not at all."""
    half = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        parquet.write_table(table, half, compression="zstd")
        half.replace(path)
    finally:
        half.unlink(missing_ok=True)


def _begin(parent: int) -> None:
    """Ctrl-C reaches the whole foreground group: the parent alone decides what it means; nobody outlives it."""
    die_with(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
