"""Residuals of all links of a cell, made once, and what each detector says to them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bags.watch.designs import RunDesigns
from bags.watch.monitors import LinkGroup, RunMonitors, group_monitors
from monitor.detectors import BlockDetector, Detector, Phase, Verdict, matched

_WORTH = 16  # steps: fewer are not quicker at once
_CHUNK = 256  # steps that observers take at a time: what they say besides residuals is not kept


class Received(NamedTuple):
    """What came over the links in the runs under one attack.

    Attributes:
        received: y^c, shape (steps, seeds, links, p).
        delivered: Shape (steps, seeds, links).
    """

    received: NDArray[np.float64]
    delivered: NDArray[np.bool_]


class Concluded(NamedTuple):
    """What monitors concluded in the runs of a cell, shapes (steps, attacks, seeds, links).

    Attributes:
        alarm: Verdicts.
        armed: Whether there is one.
        size: Largest |r| of any component, 0 where there is none.
    """

    alarm: NDArray[np.bool_]
    armed: NDArray[np.bool_]
    size: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Listening:
    """A detector that only lets the observer run."""

    promise: str = "no alarm"

    def init(self, outputs: int) -> int:
        """State: how many outputs there are."""
        return outputs

    def step(self, state: int, residual: object) -> tuple[int, Verdict]:
        """Say nothing."""
        del residual
        return state, Verdict(Phase.ARMED.value, (np.nan,) * state, alarm=False)

    def block(self, state: int, residual: NDArray[np.float64]) -> tuple[int, Verdict]:
        """Say nothing of many residuals."""
        return state, Verdict(Phase.ARMED.value, np.broadcast_to(np.nan, residual.shape), alarm=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkResiduals:
    """What the observers of all lanes said: they do not depend on the detector behind them.

    Attributes:
        shape: Axes that the lanes stand for: attacks, seeds, links.
        groups: Lanes whose monitors step together.
        residuals: Of each group, shape (steps, p, lanes of the group).
        size: Largest |r| of any component, shape (steps, lanes).
    """

    shape: tuple[int, ...]
    groups: tuple[LinkGroup, ...]
    residuals: tuple[NDArray[np.float64], ...]
    size: NDArray[np.float64]

    @classmethod
    def of(cls, runs: Sequence[Received], designs: Sequence[RunDesigns]) -> "LinkResiduals":
        """Run the observers.

        Args:
            runs: Under each attack.
            designs: What was designed for each seed.
        """
        steps, *shape = runs[0].delivered.shape
        lanes = [link for _ in runs for one in designs for link in one.links]
        groups = group_monitors(lanes, _Listening())
        monitors = RunMonitors(designs=tuple(lanes), groups=groups)
        heard = tuple(one for one in groups if not one.monitor.blind)
        residuals = tuple(np.empty((steps, _outputs(one), len(one.positions))) for one in heard)
        size, state = np.zeros((steps, len(lanes))), monitors.init()
        for start in range(0, steps, _CHUNK):
            rows = slice(start, start + _CHUNK)
            received, delivered = (np.stack([one[rows] for one in each], axis=1) for each in zip(*runs, strict=True))
            state, said = monitors.run(state, received, delivered)
            residual = said.residual.reshape(len(received), len(lanes), -1)
            size[rows] = np.nan_to_num(np.abs(residual)).max(axis=-1)
            for one, kept in zip(heard, residuals, strict=True):
                mine = residual[:, one.positions]
                kept[rows] = (mine if mine.shape[-1] == kept.shape[1] else mine[..., _channels(one)]).swapaxes(1, 2)
        return cls(shape=(len(runs), *shape), groups=heard, residuals=residuals, size=size)

    def judged_by(self, detector: Detector[Any]) -> Concluded:
        """What a detector says to them, the bits of a monitor with that detector."""
        alarm, armed = (np.zeros(self.size.shape, dtype=np.bool_) for _ in range(2))
        for group, residual in zip(self.groups, self.residuals, strict=True):
            assert group.monitor.observer is not None  # noqa: S101 - refused lanes are in no group
            phase, alarm[:, group.positions] = _judged(matched(detector, group.monitor.observer), residual)
            armed[:, group.positions] = phase == Phase.ARMED.value
        shape = (len(self.size), *self.shape)
        return Concluded(alarm.reshape(shape), armed.reshape(shape), self.size.reshape(shape))


def _outputs(group: LinkGroup) -> int:
    assert group.monitor.observer is not None  # noqa: S101 - refused lanes are in no group
    return group.monitor.observer.outputs


def _channels(group: LinkGroup) -> list[int]:
    """Components of a received vector that the observers of a group use."""
    return list(group.monitor.channels or range(_outputs(group)))


def _judged(detector: Detector[Any], residual: NDArray[np.float64]) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Phase and alarm, shape (steps, lanes): step by step around what is missing, at once elsewhere."""
    steps, outputs, lanes = residual.shape
    phase, alarm = np.empty((steps, lanes), dtype=np.uint8), np.empty((steps, lanes), dtype=np.bool_)
    gaps = np.flatnonzero(~np.isfinite(residual).all(axis=(1, 2)))
    state, k = detector.init(outputs), 0
    while k < steps:
        state, verdict = detector.step(state, residual[k])
        phase[k], alarm[k] = verdict.phase, verdict.alarm
        k += 1
        following = int(np.searchsorted(gaps, k))
        end = int(gaps[following]) if following < len(gaps) else steps
        if isinstance(detector, BlockDetector) and end - k >= _WORTH:
            state, verdict = detector.block(state, residual[k:end])
            phase[k:end], alarm[k:end] = verdict.phase, verdict.alarm
            k = end
    return phase, alarm
