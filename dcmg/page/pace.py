"""The clock of what is shown: steps at the pace of the wall clock, or at another, or one by one."""

import threading
import time
from collections import deque

from dcmg.page.messages import Clock, Time
from dcmg.page.source import Source

_CHUNK_SEC, _BEHIND_SEC, _MEASURED_SEC = 0.02, 0.25, 2.0


class Pace:
    """Drives a source from a thread of its own; `lock` is held while it does.

    Args:
        source: What is shown.
        rate: Simulated seconds a second.
        running: Whether time goes on at once.
    """

    def __init__(self, source: Source, rate: float = 1.0, *, running: bool = True) -> None:
        """Stand still until `start`."""
        self.source, self.rate, self.running, self.late, self.ended = source, rate, running, 0, False
        self.version = 0
        self.fault: str | None = None
        self.lock = threading.RLock()
        self._changed = threading.Condition(self.lock)
        self._closed = False
        self._origin: tuple[float, int] | None = None  # wall time, step
        self._made: deque[tuple[float, int]] = deque(maxlen=400)
        self._thread = threading.Thread(target=self._run, name="page-clock", daemon=True)

    def start(self) -> None:
        """Let time go on."""
        self._thread.start()

    def close(self) -> None:
        """End the thread and the source."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        if self._thread.is_alive():
            self._thread.join(timeout=10)
        self.source.close()

    def do(self, order: Clock) -> str:
        """Pause, go on, make steps, or change the rate; says what was done."""
        with self._changed:
            if order.action == "rate":
                self.rate = order.rate
            elif order.action == "step":
                self.running = False
                self._make(order.steps)
            else:
                self.running = order.action == "resume"
            self.touch()
            at = self.source.head * self.source.board.sampling_period_sec
            done = {"pause": "paused", "resume": "resumed", "rate": f"rate {self.rate:g}", "step": "stepped"}
            return f"{done[order.action]} at {at:.6g} s"

    def touch(self) -> None:
        """Say that something is to be shown anew, and that the pace begins here."""
        with self._changed:
            self._origin = None
            self._made.clear()
            self.ended = False
            self.version += 1
            self._changed.notify_all()

    def time(self) -> Time:
        """The clock as it is shown."""
        head = self.source.head
        return Time(
            step=head,
            first_step=self.source.board.trace.start,
            running=self.running and not self.ended,
            ended=self.ended,
            rate=self.rate,
            factor=self._factor(),
            late=self.late,
        )

    def _factor(self) -> float | None:
        now = time.monotonic()
        recent = [one for one in self._made if one[0] > now - _MEASURED_SEC]
        if len(recent) < 2 or recent[-1][0] - recent[0][0] < 0.2:  # noqa: PLR2004 - too short to say
            return None
        elapsed = recent[-1][0] - recent[0][0]
        return (recent[-1][1] - recent[0][1]) * self.source.board.sampling_period_sec / elapsed

    def _run(self) -> None:
        try:
            with self._changed:
                while not self._closed:
                    self._changed.wait(self._turn())
        except Exception as error:  # whoever looks is told; the traceback is ours
            self.fault = f"{type(error).__name__}: {error}"
            self.version += 1
            raise

    def _turn(self) -> float | None:
        """Make the steps that are due; how long nothing more is [s], None: until somebody says something."""
        if not self.running or self.ended:
            return None
        now = time.monotonic()
        head = self.source.head
        period = self.source.board.sampling_period_sec / self.rate
        if self._origin is None:
            self._origin = (now, head)
        due = self._origin[1] + int((now - self._origin[0]) / period) + 1 - head
        if due > 0:
            most = int(_CHUNK_SEC / period) + 1
            self.late += max(0, due - most)
            self._make(min(due, most))
            if now - self._origin[0] - (head - self._origin[1]) * period > _BEHIND_SEC:
                self._origin = None  # what cannot be kept up with is not made up for
            if due > most:
                return 0.0005  # somebody else may want the lock
        if self._origin is None:
            return 0.0005
        following = self._origin[0] + (self.source.head - self._origin[1]) * period
        return max(0.0005, following - time.monotonic())

    def _make(self, steps: int) -> None:
        made = self.source.advance(steps)
        self.ended = made < steps
        if self.ended:
            self.running = False
        self._made.append((time.monotonic(), self.source.head))
        self.version += 1
