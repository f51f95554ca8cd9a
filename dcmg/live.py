"""What a person sees while a run goes on: simulated time, steps/s, real-time factor, alarms as they come."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Self

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

if TYPE_CHECKING:
    from types import TracebackType

    from rich.console import Console


class LiveDisplay:
    """A progress bar on a terminal; plain lines for alarms above it.

    Args:
        console: where to draw; its file must not be the standard output of `--json`.
        steps: number of steps of the run, None: until somebody ends it.
        sampling_period_sec: T_s [s].
    """

    def __init__(self, console: Console, steps: int | None, sampling_period_sec: float) -> None:
        """Create the bar; nothing is drawn before the `with` block."""
        self._console = console
        self._period_sec = sampling_period_sec
        self._started: tuple[float, int] | None = None
        self._progress = Progress(
            TextColumn("{task.fields[clock]}"),
            BarColumn(bar_width=30),
            TextColumn("{task.fields[speed]}"),
            TextColumn("[red]{task.fields[alarms]}"),
            TimeElapsedColumn(),
            console=console,
            transient=not console.is_terminal,
        )
        self._alarms = 0
        self._task = self._progress.add_task("run", total=steps, clock="starting nodes", speed="", alarms="")

    def __enter__(self) -> Self:
        """Start drawing."""
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop drawing and leave the last state on the screen."""
        self._progress.stop()

    def steps(self, complete: int) -> None:
        """Show simulated time, steps/s and the real-time factor."""
        now = time.monotonic()
        if self._started is None and complete:
            self._started = (now, complete)
        speed = ""
        if self._started is not None and now > self._started[0]:
            rate = (complete - self._started[1]) / (now - self._started[0])
            speed = f"{rate:6.0f} steps/s, {rate * self._period_sec:5.1f} x real time"
        self._progress.update(
            self._task, completed=complete, clock=f"t = {complete * self._period_sec:7.2f} s", speed=speed
        )

    def say(self, line: str) -> None:
        """Print a line above the bar."""
        self._progress.console.print(line, highlight=False)

    def alarm(self, line: str) -> None:
        """Print an alarm above the bar and count it."""
        self._alarms += 1
        self._progress.update(self._task, alarms=f"{self._alarms} alarm(s)")
        self.say(f"[red]{line}")
