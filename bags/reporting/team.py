"""What monitors did as a team, gathered while the windows of a run go by."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from bags.reporting.fold import Envelope
from bags.runs.run_record import RunRecord
from bags.watch.team_record import present
from bags.wire.records import AlarmRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class MemberSummary:
    """What one member of a team did.

    Attributes:
        member: Number of the DGU that hosts it.
        present_sec: Time during which it estimated [s].
        last_error: Largest |xhat - x| of any V [V], I_t [A], v [V s] at its last step; None if it never estimated.
        accused_by: Members that ever accused it, ascending.
        first_accused_sec: When first [s], None: never.
    """

    member: int
    present_sec: float
    last_error: tuple[float, ...] | None
    accused_by: tuple[int, ...]
    first_accused_sec: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class TeamSummary:
    """A team without its single steps.

    Attributes:
        members: What each did, in the order of the DGUs.
        accepted: Whether there was a team.
        verdict: What its design says.
        alarms: Accusations that started or ended, in order of time.
        error: Largest |xhat - x| (as told, against the recorded truth) of any V, I_t, v, (members, 3); NaN while a
            member does not estimate.
    """

    members: tuple[MemberSummary, ...]
    accepted: bool
    verdict: str
    alarms: tuple[AlarmRecord, ...]
    error: Envelope

    def document(self) -> dict[str, Any]:
        """The part of the JSON document."""
        members = [asdict(one) for one in self.members]
        return {"accepted": self.accepted, "verdict": self.verdict, "members": members}


class TeamGatherer:
    """The team of a run while its windows go by."""

    def __init__(self, first: RunRecord, steps: int, length: int) -> None:
        """Before the first window of a run whose curves have stretches of so many steps."""
        members, width = len(first.topics.dgus), first.x.shape[2]
        self.error = Envelope.empty(steps, length, members, width)
        self.last: list[tuple[float, ...] | None] = [None] * members
        self.present = np.zeros(members, dtype=np.int64)
        self.alarms: list[AlarmRecord] = []
        self.run: RunRecord | None = None

    def add(self, window: RunRecord) -> None:
        """Take the next window."""
        if window.told is None or window.team is None:
            return
        self.run = window
        self.alarms += window.team.alarms
        there = present(window.told)
        apart = np.abs(window.told.estimate - window.x.reshape(window.steps, 1, -1))
        error = apart.reshape(*there.shape, -1, window.x.shape[2]).max(axis=2)
        self.error.add(error, window.first_step)
        self.present += there.sum(axis=0)
        for member in range(there.shape[1]):
            rows = np.flatnonzero(there[:, member])
            if len(rows):
                self.last[member] = tuple(error[rows[-1], member].tolist())

    def summary(self) -> TeamSummary | None:
        """What was gathered, None for a run without a team."""
        run = self.run
        if run is None or run.team is None:
            return None
        design = next(iter(run.team.designs.values()), None)
        return TeamSummary(
            members=tuple(
                _member(member, int(steps) * run.sampling_period_sec, last, self.alarms, run.sampling_period_sec)
                for member, steps, last in zip(run.topics.dgus, self.present, self.last, strict=True)
            ),
            accepted=design is not None and design.accepted,
            verdict="the bag holds no design" if design is None else design.verdict,
            alarms=tuple(self.alarms),
            error=self.error,
        )


def _member(
    member: int, present_sec: float, last: tuple[float, ...] | None, alarms: Sequence[AlarmRecord], period_sec: float
) -> MemberSummary:
    against = [one for one in alarms if one.source == member and one.active]
    return MemberSummary(
        member=member,
        present_sec=present_sec,
        last_error=last,
        accused_by=tuple(sorted({one.monitor for one in against})),
        first_accused_sec=against[0].step * period_sec if against else None,
    )
