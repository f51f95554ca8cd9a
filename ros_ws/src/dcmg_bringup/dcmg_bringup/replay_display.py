"""What a person sees of a replay that publishes, and the keys that steer it."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Self

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from dcmg.errors import CommandError
from dcmg_bringup.keys import DOWN, RIGHT, SPACE, UP

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType

    from rich.console import Console

    from dcmg_bringup.processes import ProcessGroup
    from dcmg_nodes.pace import Pace
    from dcmg_nodes.playing import Played

_FASTER, _SLOWER = 1.1, 1.0 / 1.1


class ReplayDisplay:
    """Looks on while a bag is played: a progress bar, keys, and the processes that the replay needs.

    Args:
        console: where to draw; not the standard output of `--json`.
        length_sec: what will be played [s].
        pressed: returns the keys pressed since its last call.
        group: processes without which the replay cannot go on, None without any.
    """

    def __init__(
        self, console: Console, length_sec: float, pressed: Callable[[], list[str]], group: ProcessGroup | None
    ) -> None:
        """Create the bar; nothing is drawn before the `with` block."""
        self._console, self._pressed, self._group = console, pressed, group
        columns = (TextColumn("{task.fields[where]}"), BarColumn(bar_width=30), TextColumn("{task.fields[how]}"))
        self._progress = Progress(*columns, TimeElapsedColumn(), console=console, transient=not console.is_terminal)
        self._task = self._progress.add_task("replay", total=length_sec, where="waiting for listeners", how="")

    def __enter__(self) -> Self:
        """Start drawing."""
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop drawing and leave the last state on the screen."""
        self._progress.stop()

    def say(self, line: str) -> None:
        """Print a line above the bar."""
        self._progress.console.print(line, highlight=False, soft_wrap=True)

    def look(self, pace: Pace, played: Played) -> bool:
        """Show how far the replay is, do what keys say, and see that every process lives.

        Raises:
            CommandError: one has died.
        """
        for key in self._pressed():
            _steer(pace, key)
        how = "paused" if pace.paused else "" if pace.unlimited else f"{pace.rate:.3g} x real time"
        where = f"t = {played.time_sec:7.2f} s" if played.messages else "waiting for listeners"
        self._progress.update(self._task, completed=played.time_sec, where=where, how=how)
        death = self._group.death() if self._group is not None else None
        if death is not None:
            raise CommandError(f"node {death.process} ended ({death.reason})")
        return True


def _steer(pace: Pace, key: str) -> None:
    now = time.monotonic()
    if key == SPACE:
        (pace.resume if pace.paused else pace.pause)(now)
    elif key == RIGHT:
        pace.step(now)
    elif key in {UP, DOWN} and not math.isinf(pace.rate):
        pace.set_rate(now, pace.rate * (_FASTER if key == UP else _SLOWER))
