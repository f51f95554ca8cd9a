"""What every detector is: from residuals to a verdict, one sample at a time."""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple, Protocol, TypeVar

if TYPE_CHECKING:
    from monitor.linear import Count, Flag, Vector


class Phase(IntEnum):
    """Where a monitor is; the numbers are those of dcmg_msgs/Residual."""

    REFUSED = 0
    SETTLING = 1
    CALIBRATING = 2
    ARMED = 3


class Verdict(NamedTuple):
    """What a detector concludes at one step.

    Attributes:
        phase: a Phase number, or an array of them.
        threshold: p components, units of y; NaN before it is set.
        alarm: whether any residual exceeds its threshold; only while armed.
    """

    phase: Count
    threshold: Vector
    alarm: Flag


State = TypeVar("State")


class Detector(Protocol[State]):
    """Turns residuals into alarms; a residual that is all NaN is a sample that never came."""

    def init(self, outputs: int) -> State:
        """State before the first residual of `outputs` components."""

    def step(self, state: State, residual: Vector) -> tuple[State, Verdict]:
        """Take the next residual."""
