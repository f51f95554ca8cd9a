"""Alarms that persist: another detector's alarm in n of the last m samples."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from pydantic import Field
from pydantic.dataclasses import dataclass as checked_dataclass

from monitor.detectors.protocol import Phase, Verdict, matched
from monitor.linear import select
from monitor.options import STRICT, parse_options, within, wrong_option

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from monitor.detectors.protocol import Detector
    from monitor.linear import Component, Vector
    from monitor.observer import Observer

KIND = "n_of_m"


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class NOfMOptions:
    """Options of the N-of-M detector.

    Attributes:
        n: samples with an alarm of the inner detector that make an alarm.
        m: among so many last samples.
        kind: the inner detector.
        options: its options.
    """

    n: int = Field(default=3, ge=1)
    m: int = Field(default=5, ge=1, le=1000)
    kind: str = "fixed"
    options: dict[str, object] = field(default_factory=dict)


class NOfMState(NamedTuple):
    """The inner state, and 1.0 for each of the last m - 1 samples with an inner alarm, oldest first."""

    inner: Any
    recent: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class NOfMDetector:
    """Alarm when the inner detector alarms at n or more of the last m samples, this one included.

    If it alarms at an attack-free sample with probability a, independently, the rate becomes
    sum_(k >= n) C(m, k) a^k (1 - a)^(m - k), about C(m, n) a^n. A missing sample counts as one without an alarm,
    and while the inner detector settles again there is none.

    Attributes:
        inner: the detector whose alarms are counted.
        n: how many make an alarm.
        m: among so many samples.
    """

    inner: Detector[Any]
    n: int
    m: int

    @property
    def promise(self) -> str:
        """The false-alarm promise, one line."""
        return f"no alarm without {self.n} inner alarms in {self.m} samples; the inner promise: {self.inner.promise}"

    def matched(self, observer: Observer) -> NOfMDetector:
        """Return the detector with its inner one set up for an observer."""
        return replace(self, inner=matched(self.inner, observer))

    def init(self, outputs: int) -> NOfMState:
        """State before the first residual of `outputs` components."""
        with within("options"):
            return NOfMState(self.inner.init(outputs), (0.0,) * (self.m - 1))

    def step(self, state: NOfMState, residual: Vector) -> tuple[NOfMState, Verdict]:
        """Take the next residual."""
        inner, verdict = self.inner.step(state.inner, residual)
        recent: tuple[Component, ...] = (*state.recent, select(verdict.alarm, 1.0, 0.0))
        count: Component = 0.0
        for one in recent:
            count = count + one
        alarm = (count >= self.n) & (verdict.phase == Phase.ARMED.value)
        return NOfMState(inner, recent[1:]), Verdict(verdict.phase, verdict.threshold, alarm)


def builder(
    build: Callable[[str, Mapping[str, object], float], Detector[Any]],
) -> Callable[[Mapping[str, object], float], NOfMDetector]:
    """Return what builds the detector from the options of a scenario, its inner one with `build`."""

    def build_n_of_m(options: Mapping[str, object], sampling_period_sec: float) -> NOfMDetector:
        parsed = parse_options(NOfMOptions, options, KIND)
        if parsed.n > parsed.m:
            raise wrong_option(KIND, ("n",), parsed.n, f"expected at most m = {parsed.m}")
        with within("options"):
            inner = build(parsed.kind, parsed.options, sampling_period_sec)
        return NOfMDetector(inner=inner, n=parsed.n, m=parsed.m)

    return build_n_of_m
