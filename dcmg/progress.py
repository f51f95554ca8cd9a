"""Progress of long work, on standard error, so that standard output carries the result alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

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


class LiveBar:
    """The bar of something that goes on, words before and behind it, and lines above it; drawn until it is closed.

    Args:
        console: where to draw; its file must not be the standard output of `--json`.
        total: how much there is to do, None: until somebody ends it.
        before: what it says before the bar at first.
        behind: styles of the words behind it, by name.
    """

    def __init__(self, console: Console, total: float | None, before: str, behind: dict[str, str]) -> None:
        """Draw the bar."""
        columns = [TextColumn(f"{style}{{task.fields[{name}]}}") for name, style in behind.items()]
        self._progress = Progress(
            *(TextColumn("{task.fields[before]}"), BarColumn(bar_width=30), *columns, TimeElapsedColumn()),
            console=console,
            transient=not console.is_terminal,
        )
        words: dict[str, Any] = dict.fromkeys(behind, "")
        self._task = self._progress.add_task("", total=total, before=before, **words)
        self._progress.start()

    def close(self) -> None:
        """Stop drawing and leave the last state on the screen."""
        self._progress.stop()

    def update(self, completed: float | None = None, **words: Any) -> None:  # noqa: ANN401 (strings: rich declares other keywords)
        """Show how much is done, and other words."""
        self._progress.update(self._task, completed=completed, **words)

    def say(self, line: str) -> None:
        """Print a line above the bar."""
        self._progress.console.print(line, highlight=False, soft_wrap=True)
