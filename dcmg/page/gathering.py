"""Steps out of the messages of a run that goes on elsewhere: topic by topic, as they arrive."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dcmg.page.board import Steps

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from bags.mcap.topic import Topic
    from bags.wire.codecs import StepCodec
    from bags.wire.records import DesignRecord
    from bags.wire.schema import RunTopics
    from dgu_sim.grid import Link
    from dgu_sim.relay import RelayEvent


class Gathering:
    """Puts payloads together that belong to the same step; a message that is lost leaves a gap, nothing waits for it.

    Args:
        run: DGUs and links.
    """

    def __init__(self, run: RunTopics) -> None:
        """Hear nothing yet."""
        self._run = run
        codecs = [(run.state(dgu), run.output(dgu)) for dgu in run.dgus]
        self._states = [one for one, _ in codecs]
        self._outputs = [one for _, one in codecs]
        self._residuals = [run.residual(link) for link in run.links]
        self._designs = {run.design(link).topic.name: (link, run.design(link)) for link in run.links}
        self._events = run.attack_events()
        self._waiting: dict[str, NDArray[np.void]] = {}
        self._told: list[RelayEvent] = []
        self.designs: dict[Link, DesignRecord] = {}

    @property
    def topics(self) -> Sequence[Topic]:
        """What is to be heard."""
        steps = [one.topic for one in (*self._states, *self._outputs, *self._residuals)]
        return [*steps, *(one.topic for _, one in self._designs.values()), self._events.topic]

    def take(self, payloads: dict[str, list[bytes]], after: int | None) -> Steps | None:
        """Take payloads out of their lists; return the steps that every topic has reached, if there are any.

        Args:
            payloads: By topic, in order of arrival.
            after: The next step, None: the first one that every topic has.
        """
        for name, (link, codec) in self._designs.items():
            for data in _taken(payloads[name]):
                self.designs[link] = codec.decode(data)
        self._told += [self._events.decode(data) for data in _taken(payloads[self._events.topic.name])]
        codecs = (*self._states, *self._outputs, *self._residuals)
        for one in codecs:
            fresh = one.layout.read(_taken(payloads[one.topic.name]))
            before = self._waiting.get(one.topic.name)
            self._waiting[one.topic.name] = fresh if before is None else np.concatenate([before, fresh])
        waiting = [self._waiting[one.topic.name] for one in codecs]
        if not all(len(one) for one in waiting):
            return None
        first = max(int(one["step"][0]) for one in waiting) if after is None else after
        last = min(int(one["step"][-1]) for one in waiting) + 1
        return self._steps(first, last) if last > first else None

    def _steps(self, first: int, last: int) -> Steps:
        count, p = last - first, self._run.widths.outputs
        dgus, links = len(self._run.dgus), len(self._run.links)
        alpha = self._filled(self._states, "alpha", np.full((count, dgus), np.nan), first)
        y = self._filled(self._outputs, "y", np.full((count, dgus, p), np.nan), first)
        told = {
            name: self._filled(self._residuals, name, np.full((count, links, p), np.nan), first)
            for name in ("residual", "threshold")
        }
        alarm = self._filled(self._residuals, "alarm", np.zeros((count, links), dtype=np.bool_), first)
        phase = self._filled(self._residuals, "phase", np.zeros((count, links), dtype=np.uint8), first)
        for name, rows in self._waiting.items():
            self._waiting[name] = rows[rows["step"] >= last]
        events = [one for one in self._told if one.step < last]
        self._told = [one for one in self._told if one.step >= last]
        unknown = np.full((count, dgus), np.nan)
        return Steps(
            first_step=first,
            voltage=y[:, :, 0],
            current=y[:, :, 1] if p > 1 else unknown,
            alpha=alpha,
            residual=told["residual"],
            threshold=told["threshold"],
            alarm=alarm,
            phase=phase,
            events=events,
        )

    def _filled(self, codecs: Sequence[StepCodec], name: str, target: NDArray[Any], first: int) -> NDArray[Any]:
        """Write a field of each topic where its step belongs, (steps, topics, ...)."""
        for place, codec in enumerate(codecs):
            rows = self._waiting[codec.topic.name]
            at = rows["step"].astype(np.int64) - first
            inside = (at >= 0) & (at < len(target))
            target[at[inside], place] = rows[name][inside]
        return target


def _taken(payloads: list[bytes]) -> list[bytes]:
    """What is in a list now; another thread may append to it meanwhile."""
    count = len(payloads)
    found = payloads[:count]
    del payloads[:count]
    return found
