"""Progress of long work, on standard error, so that standard output carries the result alone."""

from __future__ import annotations

from datetime import timedelta
from time import monotonic
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from typing import Self

    from bags.runs.run_record import RunRecord


def shown(windows: Iterable[RunRecord], steps: int, what: str) -> Iterator[RunRecord]:
    """Pass the windows of a run on, with a progress bar for as long as they last."""
    progress = Progress(console=Console(stderr=True), transient=True)
    task = progress.add_task(what, total=steps)
    progress.start()
    try:
        for window in windows:
            yield window
            progress.update(task, completed=window.end_step)
    finally:
        _stop(progress)


def _stop(progress: Progress) -> None:
    """Stop drawing, without the empty line that rich puts where it has drawn nothing."""
    if progress.console.is_interactive:
        progress.stop()
    else:
        progress.live.stop()


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
        _stop(self._progress)

    def update(self, completed: float | None = None, **words: Any) -> None:  # noqa: ANN401 (strings: rich declares other keywords)
        """Show how much is done, and other words."""
        self._progress.update(self._task, completed=completed, **words)

    def say(self, line: str) -> None:
        """Print a line above the bar."""
        self._progress.console.print(line, highlight=False, soft_wrap=True)


class CountBar:
    """A bar of things that are done one after the other, with the time left; a line for each tenth where no one looks.

    Args:
        what: the things.
        quiet: draw nothing.
    """

    def __init__(self, what: str, *, quiet: bool = False) -> None:
        """Draw nothing yet."""
        self._what, self._began, self._first, self._tenth = what, monotonic(), 0, -1
        self._console = Console(stderr=True, quiet=quiet)
        columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[words]}"))
        self._bar = Progress(*columns, console=self._console, disable=quiet or not self._console.is_terminal)
        self._task = self._bar.add_task(what, words="")

    def __enter__(self) -> Self:
        """Begin to draw."""
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the last state on the screen."""
        self._bar.stop()

    def show(self, done: int, total: int) -> None:
        """Show how many are done; the first call says how many were done before."""
        if self._tenth < 0:
            self._began, self._first = monotonic(), done
        spent = monotonic() - self._began
        left = spent * (total - done) / (done - self._first) if done > self._first else None
        words = f"{done} of {total}, {_clock(spent)} spent" + ("" if left is None else f", {_clock(left)} left")
        self._bar.update(self._task, completed=done, total=total, words=words, refresh=True)
        tenth = 10 * done // max(total, 1)
        if tenth > self._tenth and not self._console.is_terminal:
            self.say(f"{self._what}: {words}")
        self._tenth = tenth

    def say(self, line: str) -> None:
        """Print a line above the bar."""
        self._console.print(line, highlight=False, markup=False, soft_wrap=True)


def _clock(seconds: float) -> str:
    return str(timedelta(seconds=round(seconds)))
