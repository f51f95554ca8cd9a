"""The clock: releases step after step, as fast as the recorder keeps up or at a wall-clock pace."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dcmg_msgs.msg import Pacing, Progress, Ready

from bags.wire.schema import CLOCK_NODE
from dcmg_nodes.companions import names_in_graph
from dcmg_nodes.options import PacingMode
from dcmg_nodes.ports import CONTROL_OUT_QOS, CONTROL_QOS, Ports
from dcmg_nodes.wiring import PACING, PROGRESS, READY, Wiring

if TYPE_CHECKING:
    from dcmg_nodes.host import Host

WINDOW = 16  # steps in flight between the clock and the recorder; far below the queue depth of a topic
_REPORT_SEC = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockConfig:
    """Parameters of the clock.

    Attributes:
        steps: number of steps of the run.
        period_ns: sampling period [ns].
        mode: lockstep or realtime.
        rate: realtime factor: tick k is released at t0 + k T_s / rate.
        start_timeout_sec: how long to wait for all nodes to be ready [s].
    """

    steps: int
    period_ns: int
    mode: PacingMode
    rate: float
    start_timeout_sec: float


class ClockNode:
    """Publishes `/clock` and `/tick` for k = 0 … steps-1 once every node of the run is ready."""

    def __init__(self, wiring: Wiring, host: Host, config: ClockConfig) -> None:
        """Create the publishers and wait for the nodes' readiness."""
        self.ports = Ports(CLOCK_NODE, wiring, host)
        self._config = config
        self._clock, self._tick = wiring.topics.clock(), wiring.topics.tick()
        self._run = wiring.run
        self._waiting = set(wiring.nodes)
        self._created = time.monotonic()
        self._seen: set[str] = set()
        self._released = 0
        self._credit = WINDOW
        self._t0 = 0.0
        self._misses = 0
        self._worst_late_sec = 0.0
        self._period_sec = config.period_ns * 1e-9 / config.rate  # of the wall clock
        self.ports.waits_for(lambda: (PROGRESS,))
        node = self.ports.node
        self._pacing = node.create_publisher(Pacing, PACING, CONTROL_OUT_QOS)
        self._ready = node.create_subscription(Ready, READY, self._on_ready, CONTROL_QOS)
        self._progress = node.create_subscription(Progress, PROGRESS, self._on_progress, CONTROL_QOS)
        self._report_timer = node.create_timer(_REPORT_SEC, self._report)

    def _on_ready(self, message: Ready) -> None:
        if message.run not in {"", self._run}:
            return  # not of this run: its own process says so
        self._waiting.discard(message.node)
        if not self._waiting and not self._t0:
            self._t0 = time.monotonic()
            if self._config.mode is PacingMode.REALTIME:
                self._tick_timer = self.ports.node.create_timer(self._period_sec / 4.0, self._release_due)
            self._release_due()

    def _on_progress(self, message: Progress) -> None:
        self._credit = message.steps + WINDOW
        if self._t0:
            self._release_due()

    def _release_due(self) -> None:
        limit = min(self._credit, self._config.steps)
        if self._config.mode is PacingMode.REALTIME:
            limit = min(limit, int((time.monotonic() - self._t0) / self._period_sec) + 1)
        while self._released < limit:
            self._release(self._released)
            self._released += 1
            if self._released == self._config.steps:
                self._report()
                self.ports.finish()

    def _release(self, step: int) -> None:
        if self._config.mode is PacingMode.REALTIME:
            late_sec = time.monotonic() - self._t0 - step * self._period_sec
            self._worst_late_sec = max(self._worst_late_sec, late_sec)
            self._misses += late_sec > self._period_sec
        self.ports.publish(self._clock.topic.name, self._clock.encode(step))
        self.ports.publish(self._tick.topic.name, self._tick.encode(step))

    def _report(self) -> None:
        self._pacing.publish(
            Pacing(steps=self._released, deadline_misses=self._misses, worst_late_sec=self._worst_late_sec)
        )
        if self._waiting:
            self._seen.update(names_in_graph(self.ports.node))  # who gives up a moment before us is not who was missing
        if self._waiting and time.monotonic() - self._created > self._config.start_timeout_sec:
            missing = sorted(self._waiting - self._seen)  # the others wait for them, too
            names = ", ".join(missing or sorted(self._waiting))
            reason = f"not ready after {self._config.start_timeout_sec:g} s: {names}"
            self.ports.lifetime.fail(CLOCK_NODE, reason)
