"""What report and pictures need of a run's team, gathered window by window."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from bags.runs.run_record import RunRecord
from bags.watch.team_record import present
from bags.wire.records import AlarmRecord

_WIDTH = 3  # V, I_t, v


@final
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


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TeamOutline:
    """A team without its single steps.

    Attributes:
        members: What each did, in the order of the DGUs.
        accepted: Whether there was a team.
        verdict: What its design says.
        alarms: Accusations that started or ended, in order of time.
        error: Largest |xhat - x| (as told, against the recorded truth) of any V, I_t, v in each short stretch, shape
            (stretches, members, 3); NaN while a member does not estimate.
    """

    members: tuple[MemberSummary, ...]
    accepted: bool
    verdict: str
    alarms: tuple[AlarmRecord, ...]
    error: NDArray[np.float64]

    def document(self) -> dict[str, Any]:
        """The part of the JSON document."""
        members = [asdict(one) for one in self.members]
        return {"accepted": self.accepted, "verdict": self.verdict, "members": members}


@final
@dataclass(slots=True, kw_only=True)
class TeamSketch:
    """The team of a run while its windows go by.

    Attributes:
        stretches: Number of short stretches of the run.
        length: Steps of each.
    """

    stretches: int
    length: int
    _error: NDArray[np.float64] | None = None
    _last: list[tuple[float, ...] | None] = field(default_factory=list)
    _steps: NDArray[np.int64] | None = None
    _alarms: list[AlarmRecord] = field(default_factory=list)
    _run: RunRecord | None = None

    def add(self, window: RunRecord) -> None:
        """Take the next window."""
        if window.told is None or window.team is None:
            return
        self._run = window
        self._alarms += window.team.alarms
        there = present(window.told)
        apart = np.abs(window.told.estimate - window.x.reshape(window.steps, 1, -1))
        error = apart.reshape(*there.shape, -1, _WIDTH).max(axis=2)
        if self._error is None or self._steps is None:
            self._error = np.full((self.stretches, *error.shape[1:]), np.nan)
            self._steps = np.zeros(there.shape[1], dtype=np.int64)
            self._last = [None] * there.shape[1]
        self._steps += there.sum(axis=0)
        for member in range(there.shape[1]):
            rows = np.flatnonzero(there[:, member])
            if len(rows):
                self._last[member] = tuple(error[rows[-1], member].tolist())
        if window.steps:
            stretches = np.arange(window.first_step, window.end_step) // self.length
            starts = np.flatnonzero(np.diff(stretches, prepend=-1))
            into = stretches[starts]
            self._error[into] = np.fmax(self._error[into], np.fmax.reduceat(error, starts, axis=0))

    def outline(self) -> TeamOutline | None:
        """What was gathered, None for a run without a team."""
        run = self._run
        if run is None or run.team is None or self._error is None or self._steps is None:
            return None
        design = next(iter(run.team.designs.values()), None)
        return TeamOutline(
            members=tuple(
                _member(member, int(steps) * run.sampling_period_sec, last, self._alarms, run.sampling_period_sec)
                for member, steps, last in zip(run.topics.dgus, self._steps, self._last, strict=True)
            ),
            accepted=design is not None and design.accepted,
            verdict="the bag holds no design" if design is None else design.verdict,
            alarms=tuple(self._alarms),
            error=self._error,
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
