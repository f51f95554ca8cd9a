"""Plays a bag: takes moment after moment when it is due and when whoever listens has room for it."""

from __future__ import annotations

import signal
import time
from contextlib import ExitStack
from itertools import chain, pairwise
from typing import TYPE_CHECKING

import rclpy
from dcmg_msgs.srv import ControlReplay
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from bags.runs.playback import Moment
from dcmg_nodes.errors import NodeError
from dcmg_nodes.executor import make_executor, spin_until
from dcmg_nodes.farewell import destroy
from dcmg_nodes.options import ExecutorKind
from dcmg_nodes.pace import Pace
from dcmg_nodes.player_node import PlayerNode
from dcmg_nodes.playing import Played
from dcmg_nodes.ros_arguments import ros_arguments
from dcmg_nodes.stand_in import StandIn, doubled_steps, live_topics

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from rclpy.executors import Executor

    from bags.runs.playback import Playback
    from dcmg_nodes.playing import PlayOptions, Watcher

_LOOK_SEC = 0.05  # between two looks at keys, services and live processes
_PRECISE_SEC = 0.004  # the executor may come back this late: the rest is slept
_SETTLED_SEC = 1.0  # without a new subscriber: whoever is there has been found
_LAST_SEC = 5.0  # for the acknowledgement of the last messages
_LINGER_SEC = 1.0


def play(playback: Playback, options: PlayOptions, watcher: Watcher) -> Played:
    """Publish a bag into the ROS domain of the environment.

    Raises:
        NodeError: nobody listens, a live node is not ready or stalls, or a name cannot be published on: one line.
        BagError: the bag is damaged.
    """
    stopped: list[int] = []
    rclpy.init(args=ros_arguments(), signal_handler_options=SignalHandlerOptions.NO)
    before = {number: signal.signal(number, lambda *_: stopped.append(1)) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        with ExitStack() as stack:
            return _Player(playback, options, watcher, stopped, stack).play()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        rclpy.try_shutdown()


class _Player:
    def __init__(
        self, playback: Playback, options: PlayOptions, watcher: Watcher, stopped: list[int], stack: ExitStack
    ) -> None:
        self._playback, self._options, self._watcher, self._stopped = playback, options, watcher, stopped
        self._pace = Pace(options.rate, paused=options.paused)
        self._played = Played()
        held = live_topics(options.wiring, options.live)[0] if options.wiring else []
        names = {topic.name for topic in held}
        # live nodes hold the replay back themselves; who else listens cannot fall behind further than their window
        self._node = PlayerNode(playback, names, 0 if options.live else options.queue, self._control)
        stack.callback(destroy, self._node.node, 1)
        self._stand_in: StandIn | None = None
        if options.wiring is not None:
            doubled = doubled_steps(options.wiring, playback)
            self._stand_in = StandIn(self._node.node, options.wiring, options.live, doubled)
        self._executor: Executor = make_executor(ExecutorKind.EVENTS, self._node.node)
        stack.callback(self._executor.shutdown)
        self._held = names
        self._looked_at = self._sent_at = 0.0
        self._changes, self._timed_ns = -1, 0
        self._last_ns: int | None = None
        for name, reason in self._node.left_out.items():
            watcher.say(f"not published: {name}: {reason}")

    def play(self) -> Played:
        """Play to the end, however often, and account for it."""
        moments = self._moments()
        first = next(moments, Moment(self._playback.start_ns, []))
        # what is kept for late subscribers goes out at once: live nodes are ready only when they have it
        topics = self._playback.topics
        self._publish(Moment(first.time_ns, [one for one in first.messages if topics[one[0]].latched]))
        rest = Moment(first.time_ns, [one for one in first.messages if not topics[one[0]].latched])
        self._wait_for_listeners()
        if self._stand_in is not None:
            self._stand_in.ask()
            self._wait_for_listeners()
        start = time.perf_counter()
        self._pace.start(time.monotonic(), self._playback.start_ns)
        for moment in chain([rest], moments):
            if not self._wait_for(moment):
                self._played.interrupted = True
                break
            self._publish(moment)
        self._played.wall_sec = time.perf_counter() - start
        self._finish()
        return self._played

    def _moments(self) -> Iterator[Moment]:
        while True:
            empty = True
            for moment in self._playback.moments():
                empty = False
                yield moment
            self._played.loops += 1
            if empty or not self._options.loop:
                return
            self._pace.start(time.monotonic(), self._playback.start_ns)

    def _wait_for(self, moment: Moment) -> bool:
        """Return True when a moment may go out, False when the replay is to end."""
        stuck_since = None
        while self._look():
            wait_sec = self._pace.due_sec(moment.time_ns) - time.monotonic()
            if wait_sec > 0:
                self._idle(wait_sec)
                continue
            if self._stand_in is None or self._stand_in.allows(moment.time_ns):
                if self._node.room_for(moment, _LOOK_SEC):
                    return True
                continue
            stuck_since = stuck_since or time.monotonic()
            self._wait_for_live_nodes(self._stand_in, stuck_since)
        return False

    def _publish(self, moment: Moment) -> None:
        if self._stand_in is not None:
            for name, data in moment.messages:
                if name in self._held:
                    self._stand_in.expect(name, data)
        times = self._node.publish(moment)
        if times:
            self._time(moment.time_ns, times)
            self._played.messages += len(times)
            self._played.moments += 1
        self._last_ns = moment.time_ns
        self._played.time_sec = (moment.time_ns - self._playback.start_ns) * 1e-9
        self._pace.passed(time.monotonic(), moment.time_ns)

    def _time(self, time_ns: int, times: Sequence[float]) -> None:
        """Hold the times at which messages went out against their stamps."""
        if self._changes == self._pace.changes and not self._pace.unlimited:
            wanted_sec = (time_ns - self._timed_ns) * 1e-9 / self._pace.rate
            error_sec = times[0] - self._sent_at - wanted_sec
            self._played.between_stamps.add(error_sec)
            self._played.between_messages.add(error_sec)
            for one, other in pairwise(times):
                self._played.between_messages.add(other - one)
        self._changes, self._timed_ns, self._sent_at = self._pace.changes, time_ns, times[-1]

    def _look(self) -> bool:
        """Serve keys, services and the watcher now and then; False: the replay is to end."""
        now = time.monotonic()
        if now - self._looked_at > _LOOK_SEC:
            self._looked_at = now
            self._spin(0.0)
            if not self._watcher.look(self._pace, self._played):
                self._stopped.append(1)
        return not self._stopped

    def _idle(self, wait_sec: float) -> None:
        if wait_sec > _PRECISE_SEC:
            self._spin(min(wait_sec - _PRECISE_SEC / 2, _LOOK_SEC))
        else:
            time.sleep(wait_sec)

    def _spin(self, duration_sec: float, until: Future | None = None) -> None:
        spin_until(self._executor, until or Future(), duration_sec)

    def _wait_for_listeners(self) -> None:
        """Return when whoever is to get the first message will get it.

        Raises:
            NodeError: somebody is not there in time.
        """
        started = settled = time.monotonic()
        found = -1
        while self._look():
            now = time.monotonic()
            missing = self._missing()
            listeners = sum(self._node.listeners(name) for name in self._node.counts)
            if listeners != found:
                found, settled = listeners, now
            expected = self._stand_in is not None or self._options.wait_for
            if not missing and (expected or now - settled > _SETTLED_SEC):
                return
            if now - started > self._options.start_timeout_sec:
                raise NodeError(f"not there after {self._options.start_timeout_sec:g} s: {'; '.join(missing)}")
            self._spin(_LOOK_SEC)

    def _missing(self) -> list[str]:
        """Describe who is expected and not there."""
        missing = [f"a subscriber of {name}" for name in self._options.wait_for if not self._node.listeners(name)]
        if self._stand_in is not None:
            missing += [f"node {name}" for name in self._stand_in.not_ready]
            missing += [
                f"{count - self._node.listeners(name)} subscriber(s) of {name}"
                for name, count in self._stand_in.needed.items()
                if self._node.listeners(name) < count
            ]
        return missing

    def _wait_for_live_nodes(self, stand_in: StandIn, stuck_since: float) -> None:
        """Let the live nodes work.

        Raises:
            NodeError: one takes too long.
        """
        self._spin(_LOOK_SEC, stand_in.next_progress())
        if time.monotonic() - stuck_since > self._options.stall_timeout_sec:
            raise NodeError(
                f"the replay stalled: no conclusion from step {stand_in.steps} on {stand_in.slowest} "
                f"within {self._options.stall_timeout_sec:g} s"
            )

    def _finish(self) -> None:
        """See to it that the last messages arrive, and let the live nodes go."""
        if self._stand_in is not None:
            steps, since = self._stand_in.steps, time.monotonic()
            while not self._played.interrupted and self._last_ns is not None:
                if self._stand_in.caught_up(self._last_ns) or not self._look():
                    break
                if self._stand_in.steps > steps:
                    steps, since = self._stand_in.steps, time.monotonic()
                self._wait_for_live_nodes(self._stand_in, since)
            self._spin(_LOOK_SEC)  # events come behind the conclusions of their step
            self._stand_in.end()
            leave_by = time.monotonic() + _LINGER_SEC
            while self._stand_in.listeners and time.monotonic() < leave_by:
                self._spin(_LOOK_SEC)
            self._played.compared = self._stand_in.comparison()
        else:
            leave_by = time.monotonic() + _LAST_SEC
            for name in self._node.counts:
                self._node.acknowledged(name, max(leave_by - time.monotonic(), 0.0))
        self._played.counts, self._played.left_out = dict(self._node.counts), dict(self._node.left_out)
        self._watcher.look(self._pace, self._played)

    def _control(self, request: ControlReplay.Request, response: ControlReplay.Response) -> ControlReplay.Response:
        response.accepted = True
        now = time.monotonic()
        try:
            match request.command:
                case ControlReplay.Request.PAUSE:
                    self._pace.pause(now)
                case ControlReplay.Request.RESUME:
                    self._pace.resume(now)
                case ControlReplay.Request.STEP:
                    self._pace.step(now, max(request.steps, 1))
                case ControlReplay.Request.RATE:
                    self._pace.set_rate(now, request.rate)
                case ControlReplay.Request.STOP:
                    self._stopped.append(1)
                case ControlReplay.Request.STATUS:
                    pass
                case _:
                    raise NodeError(f"command {request.command} is none of ControlReplay's")  # noqa: TRY301 (answered below)
        except NodeError as error:
            response.accepted, response.message = False, str(error)
        response.paused, response.rate = self._pace.paused, self._pace.rate
        response.time_sec, response.messages = self._played.time_sec, self._played.messages
        return response
