"""A detector of residuals that jump."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import nan
from typing import NamedTuple

from pydantic import Field
from pydantic.dataclasses import dataclass as checked_dataclass

from monitor.detectors import Kind, Verdict
from monitor.detectors.schedule import Progress, Schedule
from monitor.linear import Flag, Vector
from monitor.options import STRICT, parse_options


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class JumpOptions:
    """Options of the jump detector.

    Attributes:
        jump: largest change of a residual from one sample to the next.
        settle_sec: time after every (re)start before it is armed [s].
    """

    jump: float = Field(gt=0.0)
    settle_sec: float = Field(default=0.5, ge=0.0)


class JumpState(NamedTuple):
    """How far it is, and the last residual."""

    progress: Progress
    before: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class JumpDetector:
    """Alarm when some |r_k - r_k-1| > jump."""

    schedule: Schedule
    jump: float

    @property
    def promise(self) -> str:
        """The false-alarm promise, one line."""
        return f"no false alarm while no residual changes by more than {self.jump:g} in one sample; set by hand"

    def init(self, outputs: int) -> JumpState:
        """State before the first residual of `outputs` components."""
        return JumpState(Progress(0, 0), (nan,) * outputs)

    def step(self, state: JumpState, residual: Vector) -> tuple[JumpState, Verdict]:
        """Take the next residual."""
        progress, stage = self.schedule.advance(state.progress, residual[0])
        jumped: Flag = False
        for now, before in zip(residual, state.before, strict=True):
            jumped = jumped | (abs(now - before) > self.jump)
        threshold = (self.jump,) * len(residual)
        return JumpState(progress, residual), Verdict(stage.phase, threshold, stage.armed & jumped)


def build(options: Mapping[str, object], sampling_period_sec: float) -> JumpDetector:
    """Build the detector from the options of a scenario."""
    parsed = parse_options(JumpOptions, options, "jump")
    settle_steps = round(parsed.settle_sec / sampling_period_sec)
    return JumpDetector(schedule=Schedule(settle_steps=settle_steps, calibrate_steps=0), jump=parsed.jump)


JUMP = Kind(JumpOptions, build)
