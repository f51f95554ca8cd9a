"""Why there was, or was no, alarm on a link at one moment of a recorded run."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bags.mcap.errors import BagError
from dcmg.certificate_view import view
from dgu_sim.attacks.wording import parameter_words
from dgu_sim.relay import Action
from monitor.detectors.protocol import Phase

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from bags.runs.reader import Run
    from bags.wire.records import StreamRecord
    from dgu_sim.grid import Link
    from dgu_sim.relay import RelayEvent

CHANNELS = (("V", "V"), ("I_t", "A"), ("v", "V s"))
BEFORE = 5
"""Samples told of before the moment."""
_NEAR_SEC = 1.0
_TESTS = {
    "by_residual": "residual of the link's observer",
    "by_plausibility": "plausibility of the input reconstructed from what the link carries",
    "by_stream": "stream guard: somebody else speaks on the link",
    "by_local": "residual of the own state, which this link alone explains",
    "suspected": "residual of the own state, which this link could explain (suspected, not accused)",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Component:
    """One component of the residual at the moment: |residual| against threshold, in its unit; ratio of the two."""

    name: str
    unit: str
    residual: float
    threshold: float
    ratio: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation:
    """Why there was, or was no, alarm.

    Attributes:
        link: as in 1-2.
        step: the moment.
        time_sec: the same [s].
        chosen: why this moment, when nobody named one.
        conclusion: the answer, one line.
        alarm: whether the link is accused at this moment, by whatever test.
        phase: of the link's monitor: refused, settling, calibrating or armed.
        accused_by: the tests that accuse, in words.
        components: of the residual.
        before: the samples before: time [s], whether it arrived, largest |r|/threshold (None without).
        sight: what this observer can and cannot see, in lines.
        attacks: attacks on the link that act at the moment, or start or stop near it, in lines.
        streams: faults of the stream near the moment, in lines.
    """

    link: str
    step: int
    time_sec: float
    chosen: str
    conclusion: str
    alarm: bool
    phase: str
    accused_by: tuple[str, ...]
    components: tuple[Component, ...]
    before: tuple[dict[str, Any], ...]
    sight: tuple[str, ...]
    attacks: tuple[str, ...]
    streams: tuple[str, ...]

    def document(self) -> dict[str, Any]:
        """For JSON: what is not finite is null."""
        document: dict[str, Any] = json.loads(json.dumps(asdict(self)), parse_constant=lambda _: None)
        return document


@dataclass(frozen=True, slots=True, kw_only=True)
class _Past:
    """A link over the whole run: arrays of (steps, …)."""

    phase: NDArray[Any]
    alarm: NDArray[np.bool_]
    delivered: NDArray[np.bool_]
    residual: NDArray[np.float64]
    threshold: NDArray[np.float64]
    tests: dict[str, NDArray[np.bool_]]
    streams: tuple[StreamRecord, ...]

    @property
    def accused(self) -> NDArray[np.bool_]:
        found = self.alarm.copy()
        for name, flags in self.tests.items():
            if name != "suspected":
                found |= flags
        return found

    @property
    def ratio(self) -> NDArray[np.float64]:
        """Largest |r_i| / threshold_i of each step; NaN where there is none."""
        with np.errstate(all="ignore"):
            ratios = np.abs(self.residual) / self.threshold
        shown = np.where(np.isnan(ratios), -np.inf, ratios).max(axis=1, initial=-np.inf)
        return np.where(np.isneginf(shown), np.nan, shown)


def explain(run: Run, link: Link, at_sec: float | None = None) -> Explanation:
    """Explain one moment of a link.

    Args:
        run: the recorded run.
        link: which link.
        at_sec: the moment [s]; None: the first alarm on the link, else where the residual came closest to one.

    Raises:
        BagError: the run has no such link or moment, or the bag is damaged.
    """
    if link not in run.links:
        raise BagError(f"--link {link}: expected a link of the run, one of {', '.join(map(str, run.links))}")
    period_sec = run.topics.sampling_period_ns * 1e-9
    past = _past(run, link)
    if not len(past.alarm):
        raise BagError(f"{run.path}: the run has no complete step: nothing to explain")
    acting = _acting(run.events, link, run.steps)
    step, chosen = _moment(past, acting, at_sec, period_sec)
    components = _components(past, step)
    attacks = _attacks(run.events, link, step, period_sec)
    record = run.designs.get(link)
    verdict = "" if record is None else record.verdict
    lines = () if record is None else view(record.certificate, past.threshold[step], _bias(run.events, link, step))
    tests = [words for name, words in _TESTS.items() if name in past.tests and past.tests[name][step]]
    if not past.tests and past.alarm[step]:
        tests = [_TESTS["by_residual"]]
    return Explanation(
        link=str(link),
        step=step,
        time_sec=round(step * period_sec, 9),
        chosen=chosen,
        conclusion=_conclusion(past, step, components, tests=tests, verdict=verdict, period_sec=period_sec)
        + (" although an attack acts on it" if acting[step] and not past.accused[step] else ""),
        alarm=bool(past.accused[step]),
        phase=Phase(int(past.phase[step])).name.lower(),
        accused_by=tuple(tests),
        components=components,
        before=tuple(_before(past, step, period_sec)),
        sight=tuple(lines),
        attacks=attacks,
        streams=_streams(past.streams, step, period_sec),
    )


def _past(run: Run, link: Link) -> _Past:
    place = run.links.index(link)
    parts: dict[str, list[NDArray[Any]]] = {}
    streams: list[StreamRecord] = []
    for window in run.windows():
        for name in ("phase", "alarm", "delivered", "residual", "threshold"):
            parts.setdefault(name, []).append(getattr(window, name)[:, place].copy())
        if window.combined is not None:
            for name in _TESTS:
                parts.setdefault(name, []).append(getattr(window.combined.verdict, name)[:, place].copy())
        streams += [one for one in window.streams if (one.source, one.monitor) == (link.source, link.target)]
    joined: dict[str, Any] = {name: np.concatenate(arrays) for name, arrays in parts.items()}
    tests = {name: joined.pop(name) for name in _TESTS if name in joined}
    return _Past(**joined, tests=tests, streams=tuple(streams))


def _acting(events: Sequence[RelayEvent], link: Link, steps: int) -> NDArray[np.bool_]:
    """Steps at which some attack acts on the link."""
    running = np.zeros(steps + 1, dtype=np.int64)
    for event in events:
        if event.link == link and event.step < steps:
            running[event.step] += 1 if event.action is Action.START else -1
    return np.cumsum(running[:steps]) > 0


def _moment(past: _Past, acting: NDArray[np.bool_], at_sec: float | None, period_sec: float) -> tuple[int, str]:
    steps = len(past.alarm)
    if at_sec is not None:
        step = round(at_sec / period_sec) if 0.0 <= at_sec < steps * period_sec else steps
        if step >= steps:
            raise BagError(f"--at {at_sec:g}: expected a moment of the run, from 0 to {(steps - 1) * period_sec:g} s")
        return step, ""
    if past.accused.any():
        return int(np.argmax(past.accused)), "the first alarm on the link"
    armed = past.phase == Phase.ARMED
    ratio = np.where(np.isnan(past.ratio), -np.inf, past.ratio)
    for where, words in ((armed & acting, "under attack"), (armed, "while the monitor was armed")):
        if where.any():
            return int(np.argmax(np.where(where, ratio, -np.inf))), f"no alarm: the largest residual {words}"
    return steps - 1, "the monitor never was armed: the last step"


def _components(past: _Past, step: int) -> tuple[Component, ...]:
    residual, threshold = past.residual[step], past.threshold[step]
    names = CHANNELS if len(residual) == len(CHANNELS) else tuple((f"y{i + 1}", "") for i in range(len(residual)))
    return tuple(
        Component(
            name=name,
            unit=unit,
            residual=float(abs(r)),
            threshold=float(limit),
            ratio=float(abs(r) / limit) if limit else np.inf,
        )
        for (name, unit), r, limit in zip(names, residual, threshold, strict=True)
        if not (np.isnan(r) and np.isnan(limit))
    )


def _conclusion(
    past: _Past, step: int, components: Sequence[Component], *, tests: Sequence[str], verdict: str, period_sec: float
) -> str:
    phase = Phase(int(past.phase[step]))
    largest = max(components, key=lambda one: -1.0 if np.isnan(one.ratio) else one.ratio, default=None)
    compared = "" if largest is None else f"|r| of {largest.name} is {largest.ratio:.3g} times its threshold"
    if past.accused[step]:
        return f"alarm, by {' and by '.join(tests)}" + (f"; {compared}" if past.alarm[step] else "")
    if phase is Phase.REFUSED:
        return f"no alarm: the link is not monitored: {verdict}"
    if not past.delivered[step]:
        return "no alarm: no sample arrived at this step"
    if phase is not Phase.ARMED:
        armed = np.flatnonzero(past.phase == Phase.ARMED)
        until = f"armed from {armed[0] * period_sec:g} s on" if len(armed) else "never armed in this run"
        return f"no alarm: the monitor is still {phase.name.lower()} ({until})"
    return f"no alarm: {compared or 'there is no residual'}"


def _before(past: _Past, step: int, period_sec: float) -> list[dict[str, Any]]:
    ratio = past.ratio
    return [
        {
            "time_sec": round(one * period_sec, 9),
            "delivered": bool(past.delivered[one]),
            "ratio": None if np.isnan(ratio[one]) else float(ratio[one]),
        }
        for one in range(max(step - BEFORE, 0), step)
    ]


def _attacks(events: Sequence[RelayEvent], link: Link, step: int, period_sec: float) -> tuple[str, ...]:
    near = round(_NEAR_SEC / period_sec)
    ends = {event.attack: event.step for event in events if event.action is Action.STOP and event.link == link}
    lines = []
    for event in events:
        end = ends.get(event.attack)
        if event.link != link or event.action is not Action.START:
            continue
        if event.step - near <= step and (end is None or step <= end + near):
            until = "the end of the run" if end is None else f"{end * period_sec:g} s"
            how = ", ".join((event.kind, *parameter_words(event.parameters)))
            lines.append(f"{how}, from {event.step * period_sec:g} s to {until} ({event.origin.value})")
    return tuple(lines)


def _bias(events: Sequence[RelayEvent], link: Link, step: int) -> list[float] | None:
    """The constant bias that acts on the link at a step, None without or with another attack."""
    acting: dict[int, RelayEvent] = {}
    for event in events:
        if event.link == link and event.step <= step:
            if event.action is Action.START:
                acting[event.attack] = event
            else:
                acting.pop(event.attack, None)
    found = [json.loads(one.parameters).get("bias") for one in acting.values() if one.kind == "bias"]
    return list(found[0]) if len(found) == len(acting) == 1 and found[0] is not None else None


def _streams(streams: Sequence[StreamRecord], step: int, period_sec: float) -> tuple[str, ...]:
    near = round(_NEAR_SEC / period_sec)
    return tuple(
        f"{one.kind} {'from' if one.active else 'over at'} {one.step * period_sec:g} s: {one.detail}"
        for one in streams
        if abs(one.step - step) <= near
    )
