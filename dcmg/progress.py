"""Progress of long work, on standard error, so that standard output carries the result alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import Progress

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from bags.runs.run_record import RunRecord


def shown(windows: Iterable[RunRecord], steps: int, what: str) -> Iterator[RunRecord]:
    """Pass the windows of a run on, with a progress bar for as long as they last."""
    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(what, total=steps)
        for window in windows:
            yield window
            progress.update(task, completed=window.end_step)
