"""What every detector is: from residuals to a verdict, one sample at a time."""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeVar, runtime_checkable

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from monitor.linear import Count, Flag, Vector
    from monitor.observer import Observer


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

    @property
    def promise(self) -> str:
        """What it promises about false alarms, on which condition and how that was set; one line."""

    def init(self, outputs: int) -> State:
        """State before the first residual of `outputs` components."""

    def step(self, state: State, residual: Vector) -> tuple[State, Verdict]:
        """Take the next residual."""


@runtime_checkable
class BlockDetector(Protocol):
    """A detector that judges many residuals at once, for runs that are evaluated offline."""

    def block(self, state: Any, residual: NDArray[np.float64]) -> tuple[Any, Verdict]:  # noqa: ANN401 - its own state
        """Take residuals none of which is missing, shape (steps, p, links): the bits of `step`, one after the other.

        The verdict's arrays have the steps as their first axis.
        """


@runtime_checkable
class ObserverDependent(Protocol):
    """A detector that computes its threshold from the observer whose residual it judges."""

    def matched(self, observer: Observer) -> Any:  # noqa: ANN401 - the same kind of detector
        """Return the detector set up for an observer."""


def matched(detector: Detector[Any], observer: Observer) -> Detector[Any]:
    """Return the detector as it must be on an observer's residual: most do not care which one."""
    if not isinstance(detector, ObserverDependent):
        return detector
    fitted: Detector[Any] = detector.matched(observer)
    return fitted
