"""When a message of a bag is due: rate, pause and step of a replay, on a clock that the caller reads."""

from __future__ import annotations

from math import inf, isinf

from dcmg_nodes.errors import NodeError

_NANOSECONDS = 1e-9


class Pace:
    """Maps stamps of a bag to times of a clock.

    Args:
        rate: factor of real time; infinite: as fast as the machine goes.
        paused: start paused.
    """

    def __init__(self, rate: float, *, paused: bool) -> None:
        """Start nowhere: `start` says when."""
        self.rate = _checked(rate)
        self.paused = paused
        self.changes = 0  # of the mapping: times across one of them are no measure of punctuality
        self._steps = 0  # to go on by although paused
        self._position_ns = 0.0
        self._since_sec: float | None = None

    @property
    def unlimited(self) -> bool:
        """Whether no clock holds the replay back."""
        return isinf(self.rate)

    def start(self, now_sec: float, time_ns: int) -> None:
        """Be at a stamp now."""
        self.changes += 1
        self._position_ns = time_ns
        self._since_sec = now_sec

    def due_sec(self, time_ns: int) -> float:
        """Time at which a stamp is due; infinite while paused, unless steps are left."""
        if self.paused:
            return -inf if self._steps else inf
        if self.unlimited or self._since_sec is None:
            return -inf
        return self._since_sec + (time_ns - self._position_ns) * _NANOSECONDS / self.rate

    def passed(self, now_sec: float, time_ns: int) -> None:
        """Note that the messages of a stamp went out."""
        if self.paused:
            self._steps = max(self._steps - 1, 0)
            self.start(now_sec, time_ns)
        elif self.unlimited:
            self.start(now_sec, time_ns)

    def pause(self, now_sec: float) -> None:
        """Stand still."""
        if not self.paused:
            self._hold(now_sec)
            self.paused = True
        self._steps = 0

    def resume(self, now_sec: float) -> None:
        """Go on from where the replay stands."""
        if self.paused:
            self.changes += 1
            self.paused, self._steps = False, 0
            self._since_sec = now_sec

    def step(self, now_sec: float, steps: int = 1) -> None:
        """Go on by so many stamps (more than those that it is still to go on by), and pause."""
        before = self._steps
        self.pause(now_sec)
        self._steps = before + steps

    def set_rate(self, now_sec: float, rate: float) -> None:
        """Change the rate from where the replay stands.

        Raises:
            NodeError: it is not positive.
        """
        wanted = _checked(rate)
        if not self.paused:
            self._hold(now_sec)
        self.rate = wanted

    def _hold(self, now_sec: float) -> None:
        """Take the position of now as the new origin."""
        self.changes += 1
        if self._since_sec is not None and not self.unlimited:
            self._position_ns += (now_sec - self._since_sec) * self.rate / _NANOSECONDS
        self._since_sec = now_sec


def _checked(rate: float) -> float:
    if not rate > 0.0:
        raise NodeError(f"rate is {rate:g}, expected a positive number")
    return rate
