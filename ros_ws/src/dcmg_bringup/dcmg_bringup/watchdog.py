"""What is wrong with a run, seen from outside: no node is waited for by itself alone."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from dcmg_bringup.processes import Death

_STOPPED_SEC = 3.0  # a process stopped for so long does not go on by itself
_LEFT_SEC = 4.0  # what the news of the end may take after the first node has left, and after the last other news
_BLINK_SEC = 1.0  # a longer pause between two looks was our own: somebody stopped the supervisor


@dataclass(frozen=True, slots=True, kw_only=True)
class Trouble:
    """Why a run cannot go on.

    Attributes:
        subject: who, and what became of it: "node dgu_3 ended".
        detail: how that is known.
    """

    subject: str
    detail: str

    def at(self, step: int) -> str:
        """In one line, once the recorded steps are counted."""
        return f"{self.subject} at step {step} ({self.detail})"


class Group(Protocol):
    """The processes of a run, on one host or several; `ProcessGroup` says what each of these does."""

    def death(self) -> Death | None:
        """Tell who ended with an error."""

    def left(self) -> list[str]:
        """Tell who ended well."""

    def stopped(self) -> list[str]:
        """Tell whom a signal has stopped."""

    def has_ended(self) -> bool:
        """Tell whether all have ended."""

    def wait(self, timeout_sec: float) -> bool:
        """Wait for all to end."""

    def stop(self) -> None:
        """End them."""

    def where(self, node: str) -> str:
        """Say on which other host a node is, as in " on host lab2"."""


class Watchdog:
    """Looks at the processes of a run, and at how long nothing has been heard of it.

    Args:
        group: the processes.
        silence_sec: how long no step may become complete [s], longer than the nodes themselves wait.
    """

    def __init__(self, group: Group, silence_sec: float) -> None:
        """Start with everything in order."""
        self._group = group
        self._silence_sec = silence_sec
        self._looked = self._heard = time.monotonic()
        self._steps = 0
        self._stopped: dict[str, float] = {}
        self._left: float | None = None

    def look(self, steps: int) -> Trouble | None:
        """Tell what is wrong, if anything is.

        Args:
            steps: complete steps as the recorder tells them.
        """
        now = time.monotonic()
        if now - self._looked > _BLINK_SEC:
            self._heard, self._left = now, None
            self._stopped.clear()
        self._looked = now
        if steps != self._steps:
            self._steps, self._heard, self._left = steps, now, None  # what is told arrives in order: the end comes last
        return self._ended(now) or self._standing(now) or self._silent(now)

    def _ended(self, now: float) -> Trouble | None:
        death = self._group.death()
        if death is not None:
            return Trouble(subject=f"{death.kind} {death.process} {death.how}", detail=death.reason)
        left = self._group.left()
        if left:
            self._left = self._left or now
            if now - self._left > _LEFT_SEC:
                return Trouble(subject=f"node {left[0]} ended", detail="exit code 0, before the run was over")
        return None

    def _standing(self, now: float) -> Trouble | None:
        stopped = self._group.stopped()
        self._stopped = {name: self._stopped.get(name, now) for name in stopped}
        for name, since in self._stopped.items():
            if now - since > _STOPPED_SEC:
                return Trouble(subject=f"node {name} stands still", detail="stopped by a signal")
        return None

    def _silent(self, now: float) -> Trouble | None:
        if now - self._heard <= self._silence_sec:
            return None
        detail = f"no step was recorded for {self._silence_sec:g} s, and neither clock nor recorder says why"
        return Trouble(subject="the run stands still", detail=detail)
