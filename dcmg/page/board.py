"""What is shown of a run, whatever it comes from: numbers over time, attacks, alarms, a log."""

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import IO, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dcmg.page.messages import Active, Entry, LinkState
from dcmg.page.trace import Trace
from dgu_sim.grid import Link
from dgu_sim.linear import FloatArray
from dgu_sim.relay import Action, RelayEvent
from monitor.detectors import Phase

_SUSPICIOUS = 0.5  # of the threshold
_MEMORY_BYTES, _MOST_STEPS, _LOG_LINES = 96e6, 60_000, 5_000

What = Literal["attack", "over", "alarm", "quiet", "clock", "note"]


class Steps(NamedTuple):
    """What happened in consecutive steps.

    Attributes:
        first_step: The first.
        voltage: V as sent, shape (steps, DGUs) [V].
        current: I_t as sent, same shape [A].
        alpha: Secondary correction, same shape [V].
        residual: Shape (steps, links, p).
        threshold: Same shape.
        alarm: Shape (steps, links).
        phase: Same shape.
        events: Attacks that start or stop.
    """

    first_step: int
    voltage: FloatArray
    current: FloatArray
    alpha: FloatArray
    residual: FloatArray
    threshold: FloatArray
    alarm: NDArray[np.bool_]
    phase: NDArray[np.uint8]
    events: Sequence[RelayEvent]


class _Said(NamedTuple):
    """A line of the log, before it has a number."""

    step: int
    what: What
    text: str
    link: str | None


@dataclass(frozen=True, slots=True)
class Channels:
    """Where what stands in the trace: DGUs, links, outputs of a link."""

    dgus: int
    links: int
    outputs: int

    @property
    def count(self) -> int:
        """All of them."""
        return 3 * self.dgus + (4 + 2 * self.outputs) * self.links

    def dgu(self, name: str) -> range:
        """Channels of voltage, current or alpha."""
        at = ("voltage", "current", "alpha").index(name) * self.dgus
        return range(at, at + self.dgus)

    def link(self, name: str) -> range:
        """Channels of score, alarm, phase or attacked of all links."""
        at = 3 * self.dgus + ("score", "alarm", "phase", "attacked").index(name) * self.links
        return range(at, at + self.links)

    def vector(self, name: str, link: int) -> range:
        """Channels of the residual or the threshold of one link."""
        at = 3 * self.dgus + 4 * self.links + (name == "threshold") * self.outputs * self.links + link * self.outputs
        return range(at, at + self.outputs)


class Board:
    """What happened so far, as far as it is kept. Not safe for several threads: whoever holds it has a lock.

    Args:
        dgus: Numbers of the DGUs.
        links: The links.
        sampling_period_sec: T_s.
        outputs: Components of a residual.
        steps: Steps that are kept, None: as many as fit into 96 MB, at most 60,000.
        file: Where they stand if there are more of them than fit.
    """

    def __init__(
        self,
        dgus: Sequence[int],
        links: Sequence[Link],
        sampling_period_sec: float,
        outputs: int = 3,
        *,
        steps: int | None = None,
        file: IO[bytes] | None = None,
    ) -> None:
        """Start empty."""
        self.dgus, self.links, self.sampling_period_sec = tuple(dgus), tuple(links), sampling_period_sec
        self.channels = Channels(len(self.dgus), len(self.links), outputs)
        fitting = max(1000, int(_MEMORY_BYTES / 8 / max(self.channels.count, 1)))
        kept = min(_MOST_STEPS, fitting) if steps is None else steps
        self.trace = Trace(self.channels.count, kept, file if kept > fitting else None)
        self.log: deque[Entry] = deque(maxlen=_LOG_LINES)
        self.lines = 0
        self._attacks: list[tuple[int, int | None, Active]] = []  # from, to, what
        self._attacked = np.zeros(len(self.links), dtype=np.int64)
        self._alarm = np.zeros(len(self.links), dtype=np.bool_)
        self._since: dict[int, int] = {}
        self.quick = max(1, round(0.1 / sampling_period_sec))

    def add(self, steps: Steps) -> None:
        """Take what happened next."""
        count = len(steps.alarm)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.abs(steps.residual) / steps.threshold
        score = np.fmax.reduce(ratio, axis=-1) if ratio.shape[-1] else np.full(steps.alarm.shape, np.nan)
        waiting: list[_Said] = []
        attacked = self._take_events(steps, count, waiting)
        flat = [one.reshape(count, -1) for one in (steps.residual, steps.threshold)]
        dgus = [steps.voltage, steps.current, steps.alpha]
        self._tell_alarms(steps, score, waiting)
        for one in sorted(waiting, key=lambda said: said.step):
            self.say(*one)
        self.trace.add(np.concatenate([*dgus, score, steps.alarm, steps.phase, attacked, *flat], axis=1, dtype=float))

    def say(self, step: int, what: What, text: str, link: str | None = None) -> None:
        """Write a line into the log."""
        self.lines += 1
        self.log.append(Entry(number=self.lines, step=step, what=what, link=link, text=text))

    def said(self, after: int, head: int) -> list[Entry]:
        """Lines behind line `after` that belong to steps before `head`."""
        return [one for one in self.log if one.number > after and one.step < max(head, 1)]

    def attacks(self, head: int) -> list[Active]:
        """The attacks that are active at the last step before `head`."""
        return [one for start, end, one in self._attacks if start < max(head, 1) and (end is None or end >= head)]

    def states(self, head: int) -> list[LinkState]:
        """The links at the last step before `head`; an alarm is shown for a tenth of a second at least."""
        row, channels = self.trace.at(head - 1), self.channels
        recent = self.trace.span(channels.link("alarm"), max(0, head - self.quick), head)
        alarms = np.fmax.reduce(recent, axis=-1, initial=0.0)
        numbers = (row[one.start : one.stop] for one in map(channels.link, ("score", "phase", "attacked")))
        return [
            LinkState(state=_state(alarm, one, phase), attacked=hit > 0, score=number(one))
            for alarm, one, phase, hit in zip(alarms, *numbers, strict=True)
        ]

    def _take_events(self, steps: Steps, count: int, waiting: list[_Said]) -> FloatArray:
        attacked = np.empty((count, len(self.links)))
        events, row = sorted(steps.events, key=lambda one: one.step), 0
        for event in events:
            at = min(max(event.step - steps.first_step, 0), count)
            attacked[row:at], row = self._attacked > 0, at
            self._take_event(event, waiting)
        attacked[row:] = self._attacked > 0
        return attacked

    def _take_event(self, event: RelayEvent, waiting: list[_Said]) -> None:
        name, position = str(event.link), self.links.index(event.link)
        if event.action is Action.START:
            self._attacked[position] += 1
            self._begin(event, name, waiting)
            return
        self._attacked[position] -= 1
        for place, (start, end, one) in enumerate(self._attacks):
            if one.number == event.attack and end is None and start <= event.step:
                self._attacks[place] = (start, event.step, one)
        told = f"attack {event.attack} ({event.kind}) on {arrow(event.link)} is over"
        waiting.append(_Said(event.step, "over", told, name))

    def _begin(self, event: RelayEvent, name: str, waiting: list[_Said]) -> None:
        told = f"attack {event.attack} on {arrow(event.link)}: {event.kind} {event.parameters}"
        waiting.append(_Said(event.step, "attack", told, name))
        for place, (start, end, one) in enumerate(self._attacks):
            if one.number == event.attack:
                self._attacks[place] = (start, end, one.model_copy(update={"links": [*one.links, name]}))
                return
        active = Active(
            number=event.attack,
            links=[name],
            attack=event.kind,
            parameters=event.parameters,
            since_step=event.step,
        )
        self._attacks = [*self._attacks[-_LOG_LINES:], (event.step, None, active)]

    def _tell_alarms(self, steps: Steps, score: FloatArray, waiting: list[_Said]) -> None:
        before = np.vstack([self._alarm[None], steps.alarm[:-1]])
        for row, at in zip(*np.nonzero(before != steps.alarm), strict=True):
            link, step = self.links[at], steps.first_step + int(row)
            if steps.alarm[row, at]:
                self._since[at] = step
                told = f"DGU {link.target} accuses what DGU {link.source} sends: {score[row, at]:.3g} x threshold"
                waiting.append(_Said(step, "alarm", f"alarm on {arrow(link)}: {told}", str(link)))
            else:
                lasted = (step - self._since.get(at, step)) * self.sampling_period_sec
                waiting.append(_Said(step, "quiet", f"alarm on {arrow(link)} is over after {lasted:.4g} s", str(link)))
        if len(steps.alarm):
            self._alarm = steps.alarm[-1].copy()


def arrow(link: Link) -> str:
    """A link as people read it."""
    return f"{link.source} → {link.target}"


def number(value: float) -> float | None:
    """A finite number, or None."""
    return float(value) if np.isfinite(value) else None


def numbers(values: Iterable[float]) -> list[float | None]:
    """Finite numbers, None for others."""
    return [number(one) for one in values]


def _state(
    alarm: float, score: float, phase: float
) -> Literal["refused", "settling", "calibrating", "quiet", "suspicious", "alarm"]:
    if alarm > 0:
        return "alarm"
    if phase == Phase.REFUSED:
        return "refused"
    if phase == Phase.CALIBRATING:
        return "calibrating"
    if phase != Phase.ARMED:
        return "settling"
    return "suspicious" if score >= _SUSPICIOUS else "quiet"
