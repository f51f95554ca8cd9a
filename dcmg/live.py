"""What a person sees while a run goes on: simulated time, steps/s, real-time factor, alarms as they come."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from dcmg.progress import LiveBar

if TYPE_CHECKING:
    from rich.console import Console


class LiveDisplay:
    """A progress bar on a terminal; plain lines for alarms above it. To be closed.

    Args:
        console: where to draw; its file must not be the standard output of `--json`.
        steps: number of steps of the run, None: until somebody ends it.
        sampling_period_sec: T_s [s].
    """

    def __init__(self, console: Console, steps: int | None, sampling_period_sec: float) -> None:
        """Draw the bar."""
        self._period_sec = sampling_period_sec
        self._started: tuple[float, int] | None = None
        self._alarms = 0
        self._bar = LiveBar(console, steps, "starting nodes", {"speed": "", "alarms": "[red]"})
        self.say, self.close = self._bar.say, self._bar.close

    def steps(self, complete: int) -> None:
        """Show simulated time, steps/s and the real-time factor."""
        now = time.monotonic()
        if self._started is None and complete:
            self._started = (now, complete)
        speed = ""
        if self._started is not None and now > self._started[0]:
            rate = (complete - self._started[1]) / (now - self._started[0])
            speed = f"{rate:6.0f} steps/s, {rate * self._period_sec:5.1f} x real time"
        self._bar.update(complete, before=f"t = {complete * self._period_sec:7.2f} s", speed=speed)

    def alarm(self, line: str) -> None:
        """Print an alarm above the bar and count it."""
        self._alarms += 1
        self._bar.update(alarms=f"{self._alarms} alarm(s)")
        self.say(f"[red]{line}")
