"""Run the cells of a study; finished ones are kept, so an interrupted study goes on where it was."""

from collections.abc import Callable, Sequence
from pathlib import Path

import pyarrow as pa

from bags.study.cells import StudyCell
from bags.study.dataset import lay_out
from bags.study.errors import StudyError
from bags.study.evaluate import SCHEMA
from bags.study.parts import Parts
from bags.study.pool import Pool

_PARTS = "parts"


def run_study(
    cells: Sequence[StudyCell],
    out: Path,
    pool: Pool,
    progress: Callable[[int, int], object] | None = None,
    say: Callable[[str], object] | None = None,
) -> Path:
    """Compute what is missing and write the table of all cells.

    Each cell's rows stand in a file of their own below `out/parts`, named by a digest of all they follow from, and get
    there in one move: a study that is interrupted or killed at any moment loses the cells in work and nothing else. A
    part that does not agree with its check sum or its cell is computed again. No more than one part is in memory here.

    Args:
        cells: The study.
        out: Its folder.
        pool: Who computes.
        progress: Called with the number of cells that are done and the number of all.
        say: Called with a line for each cell that is computed again.

    Returns:
        Folder of the table, a Parquet data set: columns as in `evaluate.SCHEMA`, files in the order of the cells.

    Raises:
        StudyError: A cell fails, or the folder cannot be written.
    """
    say, progress = say or _nothing, progress or _nothing
    try:
        parts = Parts(out / _PARTS, SCHEMA)
        missing = [cell for cell in cells if not _is_kept(parts, cell, say)]
        done = len(cells) - len(missing)
        progress(done, len(cells))
        for number, _ in enumerate(pool.compute(missing, parts, say), start=done + 1):
            progress(number, len(cells))
        for cell in missing:
            found = parts.read(cell.key)
            if not isinstance(found, pa.Table):
                where = parts.path(cell.key)
                raise StudyError(f"{where}: {found or 'is gone'}, though just written: start again to go on")
        return lay_out(cells, parts, out)
    except (OSError, pa.ArrowException) as error:
        raise StudyError(f"{out}: expected a folder that can be written and read: {error}") from error


def _is_kept(parts: Parts, cell: StudyCell, say: Callable[[str], object]) -> bool:
    found = parts.read(cell.key)
    if isinstance(found, str):
        say(f"{parts.path(cell.key)}: {found}: computed again")
    return isinstance(found, pa.Table)


def _nothing(*_: object) -> None:
    """Tell nobody."""
