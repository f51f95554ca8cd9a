"""What a run says about its team, as arrays and documents."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bags.wire.records import AlarmRecord, DesignRecord, HistoryRecord
from bags.wire.schema import RunTopics
from monitor.link_monitor import MonitorOutput
from monitor.measures import changed
from monitor.team import MemberOutput, MemberPhase

_VECTORS = ("estimate", "disagreement", "threshold")


@dataclass(frozen=True, slots=True, kw_only=True)
class TeamArrays:
    """What all members told over some steps; axes "members" and "dgus" are those of the team's topics.

    Attributes:
        inputs: Announced inputs, shape (steps, announcing DGUs, 2): I_L [A], V_ref + alpha [V].
        phase: Shape (steps, members), constants of TeamEstimate.msg.
        alarm: Who accuses whom, shape (steps, members, members).
        estimate: As told, shape (steps, members, 3 dgus) [V, A, V s].
        disagreement: Shape (steps, members, 3 members) [V, A, V s].
        threshold: Likewise.
    """

    inputs: NDArray[np.float64]
    phase: NDArray[np.uint8]
    alarm: NDArray[np.bool_]
    estimate: NDArray[np.float64]
    disagreement: NDArray[np.float64]
    threshold: NDArray[np.float64]

    @classmethod
    def empty(cls, topics: RunTopics, steps: int) -> "TeamArrays":
        """Arrays to be filled."""
        team = len(topics.dgus)
        vectors = {name: np.full((steps, team, topics.widths.states * team), np.nan) for name in _VECTORS}
        return cls(
            inputs=np.full((steps, len(topics.announcing), 2), np.nan),
            phase=np.zeros((steps, team), dtype=np.uint8),
            alarm=np.zeros((steps, team, team), dtype=np.bool_),
            **vectors,
        )

    def accusation(self, row: int, member: int, accused: int) -> MonitorOutput:
        """Verdict of one member on another at one step, by their positions."""
        return accusation(self.at(row, member), accused)

    def at(self, row: int, member: int) -> MemberOutput:
        """What one member told at one step, as numbers."""
        vectors = (tuple(getattr(self, name)[row, member].tolist()) for name in _VECTORS)
        return MemberOutput(int(self.phase[row, member]), tuple(self.alarm[row, member].tolist()), *vectors)

    def put(self, row: int, member: int, output: MemberOutput) -> None:
        """Write down what one member told."""
        self.phase[row, member], self.alarm[row, member] = output.phase, output.alarm
        for name in _VECTORS:
            getattr(self, name)[row, member] = getattr(output, name)


@dataclass(frozen=True, slots=True, kw_only=True)
class TeamRecord:
    """What a bag says about its team besides what was told at every step.

    Attributes:
        designs: Of each member, by its DGU.
        alarms: Accusations that started or ended, in order of time; `source` is the accused member.
        histories: Experiments on the whole grid.
    """

    designs: Mapping[int, DesignRecord]
    alarms: tuple[AlarmRecord, ...]
    histories: tuple[HistoryRecord, ...]


def accusation(output: MemberOutput, accused: int) -> MonitorOutput:
    """A member's verdict on another, by its position, as an alarm tells it."""
    width = len(output.disagreement) // len(output.alarm)
    part = slice(width * accused, width * (accused + 1))
    return MonitorOutput(
        phase=output.phase,
        alarm=output.alarm[accused],
        estimate=(),
        residual=output.disagreement[part],
        threshold=output.threshold[part],
    )


def accusation_changes(alarm: NDArray[np.bool_], before: NDArray[np.bool_]) -> list[tuple[int, int, int]]:
    """Row, accusing and accused member (positions) of every accusation that starts or ends, in order.

    Args:
        alarm: Verdicts, shape (steps, members, members).
        before: Verdicts at the step before, shape (members, members).
    """
    found = np.nonzero(changed(alarm, before))
    return [(int(row), int(one), int(two)) for row, one, two in zip(*found, strict=True)]


def present(arrays: TeamArrays) -> NDArray[np.bool_]:
    """Where members estimate, shape (steps, members)."""
    return np.asarray(arrays.phase == MemberPhase.PRESENT.value)
