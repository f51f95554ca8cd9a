"""One member of a team as its process runs it: what it measured and was told in, what it tells out."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from math import nan
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from monitor.distributed.gains import NodeGains
from monitor.distributed.node import NodeObserver
from monitor.linear import Vector, is_finite
from monitor.team.plan import WIDTH, Lie, Presence, there

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from monitor.detectors import Detector


_GAINS = ("E", "F", "L", "H", "C", "chi", "start")


class MemberPhase(IntEnum):
    """Whether a member estimates; the numbers are those of dcmg_msgs/TeamEstimate."""

    REFUSED = 0
    ABSENT = 1
    PRESENT = 2


class MemberOutput(NamedTuple):
    """What a member tells at one step.

    Attributes:
        phase: a MemberPhase number.
        alarm: one a member of the team, whether it is accused; False for those not heard.
        estimate: 3 a member, xhat as told; NaN unless PRESENT.
        disagreement: 3 a member, largest |its estimate - mine| of any V, I_t, v one step before; NaN without.
        threshold: 3 a member; NaN before it is set.
    """

    phase: int
    alarm: tuple[bool, ...]
    estimate: tuple[float, ...]
    disagreement: tuple[float, ...]
    threshold: tuple[float, ...]

    @property
    def told(self) -> tuple[float, ...] | None:
        """The estimate, None when there is none: the token that says "absent"."""
        return self.estimate if self.phase == MemberPhase.PRESENT.value else None


class MemberState(NamedTuple):
    """State before a step.

    Attributes:
        step: number k of the step to come.
        z: observer state at k-1, None while the member does not estimate.
        y: outputs at k-1.
        estimate: own estimate at k-1.
        checks: detector state of each neighbour.
    """

    step: int
    z: Vector | None
    y: tuple[float, ...]
    estimate: tuple[float, ...]
    checks: tuple[Any, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Member:
    """A node of D (6) in sampled form, one step behind itself: at step k it hears the estimates of step k-1.

        z_k = E z_k-1 + F u_k-1 + L y_k-1 + chi sum_j a_ij (xhat_j,k-1 - xhat_i,k-1),   xhat_k = z_k + H y_k

    so nobody waits in a circle and the errors obey the equation that the design proves stable. A member that comes (or
    lacked a sample) starts from the mean of what its neighbours told, corrected to fit its own output; an absent one
    is left out of the sums. The disagreement with each neighbour goes through a detector: both estimates converge to
    the one state of the grid, so what is left between them is a false estimate, or a false output that one measures.

    Attributes:
        observer: None when the design was refused.
        team: number of members.
        channels: positions of the outputs used in what the member measures.
        detector: on the disagreement with one neighbour, 3 components.
        isolate: an accused neighbour is left out of the sums, from the estimate on that it is accused for.
        presence: events of this member, in order of step.
        lies: of this member.
    """

    observer: NodeObserver | None
    team: int
    channels: tuple[int, ...]
    detector: Detector[Any]
    isolate: bool
    presence: tuple[Presence, ...]
    lies: tuple[Lie, ...]

    def document(self) -> dict[str, object]:
        """What it runs, for JSON: the channels, and the node's matrices unless the design was refused."""
        node, found = self.observer, {"channels": list(self.channels)}
        if node is None:
            return dict(found)
        gains = {name: np.asarray(getattr(node.gains, name)).tolist() for name in _GAINS}
        lists = {name: list(getattr(node, name)) for name in ("neighbours", "weights")}
        return {**found, **lists, **gains, "correction": node.correction.tolist(), "begin": node.begin.tolist()}

    def init(self) -> MemberState:
        """State before step 0."""
        return MemberState(0, None, (), (), tuple(self.detector.init(WIDTH) for _ in self._neighbours))

    def step(
        self,
        state: MemberState,
        y: Sequence[float],
        inputs_before: Sequence[float],
        told_before: Sequence[Sequence[float] | None],
    ) -> tuple[MemberState, MemberOutput]:
        """Take step k.

        Args:
            state: state before it.
            y: outputs of the DGUs that the member hears, 3 each; NaN where a sample is missing.
            inputs_before: announced inputs at k-1; not used at step 0.
            told_before: what each neighbour told at k-1, None where it was absent.
        """
        observer = self.observer
        if observer is None:
            return state, self._silent(MemberPhase.REFUSED)
        used = tuple([y[channel] for channel in self.channels])
        checks, disagreement, threshold, accused = self._check(state, told_before)
        listened = [None if self.isolate and wrong else told for told, wrong in zip(told_before, accused, strict=True)]
        z = self._advance(observer, state, used, inputs_before, listened)
        following = MemberState(state.step + 1, z, used, (), checks)
        if z is None:
            return following, self._silent(MemberPhase.ABSENT)._replace(threshold=self._spread(threshold))
        estimate = tuple(map(float, observer.output(z, used).estimate))
        output = MemberOutput(
            MemberPhase.PRESENT.value,
            self._flags(accused),
            self._as_told(estimate, state.step),
            self._spread(disagreement),
            self._spread(threshold),
        )
        return following._replace(estimate=estimate), output

    @property
    def _neighbours(self) -> tuple[int, ...]:
        return () if self.observer is None else self.observer.neighbours

    def _advance(
        self,
        observer: NodeObserver,
        state: MemberState,
        y: tuple[float, ...],
        inputs_before: Sequence[float],
        listened: Sequence[Sequence[float] | None],
    ) -> Vector | None:
        """Observer state at this step, None when the member is not there or lacks an output."""
        if not there(self.presence, state.step) or not all(is_finite(one) for one in y):
            return None
        if state.z is None:
            others = [told for told in listened if told is not None]
            return observer.join(y, _mean(others)) if others else observer.init(y)
        received: list[tuple[Vector, bool]] = [
            (state.estimate, False) if told is None else (told, True) for told in listened
        ]
        return observer.step(state.z, inputs_before, state.y, state.estimate, received)

    def _as_told(self, estimate: tuple[float, ...], step: int) -> tuple[float, ...]:
        for lie in self.lies:
            if lie.start <= step and (lie.stop is None or step < lie.stop):
                estimate = tuple([one + lie.bias[at % WIDTH] for at, one in enumerate(estimate)])
        return estimate

    def _check(
        self, state: MemberState, told_before: Sequence[Sequence[float] | None]
    ) -> tuple[tuple[Any, ...], list[tuple[float, ...]], list[tuple[float, ...]], tuple[bool, ...]]:
        """Detector states, disagreements, thresholds and verdicts of all neighbours."""
        checks, disagreements, thresholds, accused = [], [], [], []
        for told, check in zip(told_before, state.checks, strict=True):
            apart = _apart(told, state.estimate) if told is not None and state.estimate else (nan,) * WIDTH
            following, verdict = self.detector.step(check, apart)
            checks.append(following)
            disagreements.append(apart)
            thresholds.append(tuple(map(float, verdict.threshold)))
            accused.append(bool(verdict.alarm))
        return tuple(checks), disagreements, thresholds, tuple(accused)

    def _spread(self, vectors: Sequence[Sequence[float]]) -> tuple[float, ...]:
        """Vectors of the neighbours at their places among all members, NaN elsewhere."""
        placed = [nan] * (WIDTH * self.team)
        for other, vector in zip(self._neighbours, vectors, strict=True):
            placed[WIDTH * other : WIDTH * (other + 1)] = vector
        return tuple(placed)

    def _flags(self, accused: Sequence[bool]) -> tuple[bool, ...]:
        marked = {other for other, alarm in zip(self._neighbours, accused, strict=True) if alarm}
        return tuple([other in marked for other in range(self.team)])

    def _silent(self, phase: MemberPhase) -> MemberOutput:
        nothing = (nan,) * (WIDTH * self.team)
        return MemberOutput(phase.value, (False,) * self.team, nothing, nothing, nothing)


def _mean(vectors: Sequence[Sequence[float]]) -> tuple[float, ...]:
    share = 1.0 / len(vectors)
    total = (0.0,) * len(vectors[0])
    for vector in vectors:  # not sum(): it rounds differently from Python 3.12 on
        total = tuple([one + two for one, two in zip(total, vector, strict=True)])
    return tuple([share * one for one in total])


def _apart(theirs: Sequence[float], own: Sequence[float]) -> tuple[float, ...]:
    """Largest difference of any V, any I_t, any v."""
    return tuple(
        [
            max([abs(one - two) for one, two in zip(theirs[kind::WIDTH], own[kind::WIDTH], strict=True)])
            for kind in range(WIDTH)
        ]
    )


def node_of(document: Mapping[str, Any]) -> NodeObserver | None:
    """The node that `Member.document` tells of, None when its design was refused."""
    if "E" not in document:
        return None
    n = len(document["E"])
    gains = {name: np.asarray(document[name], dtype=np.float64) for name in ("E", "F", "L", "H", "C", "start")}
    return NodeObserver(
        gains=NodeGains(**{**gains, "F": gains["F"].reshape(n, -1)}, chi=float(document["chi"])),
        neighbours=tuple(document["neighbours"]),
        weights=tuple(document["weights"]),
        correction=np.asarray(document["correction"], dtype=np.float64),
        begin=np.asarray(document["begin"], dtype=np.float64),
    )
