"""What a person sees of a replay that publishes, and the keys that steer it."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

from dcmg.errors import CommandError
from dcmg.progress import LiveBar
from dcmg_bringup.keys import DOWN, RIGHT, SPACE, UP

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.console import Console

    from dcmg_bringup.processes import ProcessGroup
    from dcmg_nodes.pace import Pace
    from dcmg_nodes.playing import Played

_FASTER, _SLOWER = 1.1, 1.0 / 1.1


class ReplayDisplay:
    """Looks on while a bag is played: a progress bar, keys, and the processes that the replay needs. To be closed.

    Args:
        console: where to draw; not the standard output of `--json`.
        length_sec: what will be played [s].
        pressed: returns the keys pressed since its last call.
        group: processes without which the replay cannot go on, None without any.
    """

    def __init__(
        self, console: Console, length_sec: float, pressed: Callable[[], list[str]], group: ProcessGroup | None
    ) -> None:
        """Draw the bar."""
        self._pressed, self._group = pressed, group
        self._bar = LiveBar(console, length_sec, "waiting for listeners", {"how": ""})
        self.say, self.close = self._bar.say, self._bar.close

    def look(self, pace: Pace, played: Played) -> bool:
        """Show how far the replay is, do what keys say, and see that every process lives.

        Raises:
            CommandError: one has died.
        """
        for key in self._pressed():
            _steer(pace, key)
        how = "paused" if pace.paused else "" if pace.unlimited else f"{pace.rate:.3g} x real time"
        where = f"t = {played.time_sec:7.2f} s" if played.messages else "waiting for listeners"
        self._bar.update(played.time_sec, before=where, how=how)
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
