"""Where what is shown comes from."""

from contextlib import AbstractContextManager
from typing import Protocol

from bags.runs.live import LiveRun
from dcmg.page.board import Board
from dcmg.page.messages import Attack, Clock, Outline, Time


class RefusalError(Exception):
    """A command that cannot be done, in one line for the person who gave it."""


class Source(Protocol):
    """A run that can be watched, and perhaps steered. Called under one lock.

    Attributes:
        outline: What does not change.
        board: What happened so far.
    """

    @property
    def outline(self) -> Outline:
        """What does not change."""

    @property
    def board(self) -> Board:
        """What happened so far, and perhaps (a bag) what happens later."""

    @property
    def head(self) -> int:
        """One past the step that is shown."""

    def advance(self, steps: int) -> int:
        """Go on by so many steps; return how many there were: 0 at the end."""

    def seek(self, step: int) -> None:
        """Show another step; raises RefusalError where there is nothing but the present."""

    def attack(self, order: Attack) -> str:
        """Check, start, change or stop an attack, and say in a line what was done; raises RefusalError."""

    def fork(self) -> LiveRun:
        """A run that goes on from the moment that is shown, for whoever asks what if; raises RefusalError."""

    def close(self) -> None:
        """Give back what is held."""


class Driver(Protocol):
    """What lets a source go on, in a thread of its own.

    Attributes:
        source: What is shown.
        lock: Held by whoever touches the source.
        version: Grows whenever there is something new to show.
        fault: Why it cannot go on, None: it can.
    """

    version: int

    @property
    def source(self) -> Source:
        """What is shown."""

    @property
    def lock(self) -> AbstractContextManager[bool]:
        """Held by whoever touches the source."""

    @property
    def fault(self) -> str | None:
        """Why it cannot go on."""

    def start(self) -> None:
        """Let time go on."""

    def close(self) -> None:
        """End, and give back what is held."""

    def do(self, order: Clock) -> str:
        """Pause, go on, make steps, or change the rate; says what was done, or raises RefusalError."""

    def touch(self) -> None:
        """Say that something is to be shown anew."""

    def time(self) -> Time:
        """The clock as it is shown."""
