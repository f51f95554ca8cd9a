"""A run over ROS 2 as what the page shows."""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import TYPE_CHECKING

from bags.wire.schema import topics_of
from dcmg.page.attack_forms import order_of
from dcmg.page.board import Board
from dcmg.page.gathering import Gathering
from dcmg.page.messages import Time
from dcmg.page.outlines import of_record, outline
from dcmg.page.source import RefusalError
from dcmg_bringup.domain import running_systems
from dcmg_nodes.page_node import PageNode
from dgu_sim.attacks import build_attack
from dgu_sim.errors import AttackError

if TYPE_CHECKING:
    from bags.runs.live import LiveRun
    from dcmg.page.messages import Attack, Clock
    from dcmg_bringup.domain import RunningSystem
    from dgu_sim.scenario import Scenario

_LOOK_SEC, _MEASURED_SEC, _DESIGNS_SEC = 1.0, 2.0, 10.0


class RosRun:
    """A running system, and its clock: both a `Source` and the `Driver` of it.

    Args:
        system: the run, whose domain this process is in already.
        scenario: what it runs.
    """

    def __init__(self, system: RunningSystem, scenario: Scenario) -> None:
        """Join, and wait for what the monitors say about their designs."""
        self._system, topics = system, topics_of(scenario)
        self.fault: str | None = None
        self.version = 0
        self.lock = threading.RLock()
        self._gathering = Gathering(topics)
        self.board = Board(topics.dgus, topics.links, scenario.sampling_period_sec, topics.widths.outputs)
        self._made: deque[tuple[float, int]] = deque(maxlen=100)
        self._looked = time.monotonic()
        self._over = False
        self._node = PageNode(self._gathering.topics, self._tick)
        self._thread = threading.Thread(target=self._node.spin, name="page-ros", daemon=True)
        self._thread.start()
        until = time.monotonic() + _DESIGNS_SEC
        while len(self._gathering.designs) < len(topics.links) and time.monotonic() < until:
            time.sleep(0.02)  # the pace of looking
        with self.lock:
            links = [of_record(link, self._gathering.designs.get(link)) for link in topics.links]
        self.outline = outline(
            scenario,
            links,
            topics.dgus,
            source="ros",
            name=scenario.name,
            sampling_period_sec=scenario.sampling_period_sec,
            end_step=None,
            outputs=topics.widths.outputs,
            bag=f"{system.out}/bag",
        )

    @property
    def source(self) -> RosRun:
        """Itself."""
        return self

    @property
    def head(self) -> int:
        """One past the newest step that is complete here."""
        return self.board.trace.end

    def start(self) -> None:
        """It goes on by itself."""

    def close(self) -> None:
        """Leave the run."""
        self._node.leave()
        self._thread.join(timeout=5)
        self._node.close()

    def touch(self) -> None:
        """Say that something is to be shown anew."""
        with self.lock:
            self.version += 1

    def do(self, order: Clock) -> str:
        """Refuse: the run has its own clock."""
        raise RefusalError(f"{order.action}: a run over ROS keeps its own time")

    def advance(self, steps: int) -> int:
        """Nothing is made here; see `Source`."""
        return 0 * steps

    def seek(self, step: int) -> None:
        """Refuse."""
        raise RefusalError(f"step {step}: a live run shows the present; its bag shows every moment")

    def fork(self) -> LiveRun:
        """Refuse."""
        raise RefusalError("what if: a run over ROS cannot be forked; simulate its scenario, or open its bag")

    def attack(self, order: Attack) -> str:
        """Call the attacker; see `Source`."""
        links, parameters = order_of(order)
        try:
            if order.action == "check":
                return self._checked(order, parameters)
            if order.action == "change":
                self._checked(order, parameters)
            if order.action in {"stop", "change"}:
                count, step = self._node.stop(links[0])
                if order.action == "stop":
                    return f"stopped {count} attack(s) on {links[0]} from step {step} on"
            more = {**parameters, "anyway": True} if order.anyway else parameters
            number, step = self._node.start(links[0], order.attack, more, order.duration_sec)
        except (AttackError, ValueError) as error:
            raise RefusalError(str(error)) from error
        except TimeoutError as error:
            raise RefusalError("the attacker does not answer: has the run ended?") from error
        done = "changed to" if order.action == "change" else "started"
        return f"{done} attack {number}: {order.attack} on {', '.join(map(str, links))} from step {step} on"

    def time(self) -> Time:
        """The clock as it is shown."""
        recent = [one for one in self._made if one[0] > time.monotonic() - _MEASURED_SEC]
        factor = None
        if len(recent) > 1 and recent[-1][0] > recent[0][0]:
            elapsed = recent[-1][0] - recent[0][0]
            factor = (recent[-1][1] - recent[0][1]) * self.board.sampling_period_sec / elapsed
        return Time(
            step=self.head,
            first_step=self.board.trace.start,
            running=not self._over,
            ended=self._over,
            rate=1.0,
            factor=factor,
            late=self._node.deadline_misses,
        )

    def _checked(self, order: Attack, parameters: dict[str, object]) -> str:
        """What can be seen without the running system."""
        own = {name: value for name, value in parameters.items() if name != "links"}
        links, _ = order_of(order)
        known = set(self.board.links)
        for link in links:
            if link not in known:
                raise RefusalError(f"link {link}: expected a communication link of this run")
        build_attack(order.attack, own).check_links(links)
        return f"{order.attack} on {', '.join(order.links)}: can start"

    def _tick(self) -> None:
        """Take what has arrived, in the thread that hears it; it never waits: others may wait for an answer."""
        if not self.lock.acquire(blocking=False):
            return
        try:
            self._take()
        finally:
            self.lock.release()

    def _take(self) -> None:
        steps = self._gathering.take(self._node.payloads, self.head or None)
        if steps is not None:
            if not self.head:
                self.board.trace.end = steps.first_step
            self.board.add(steps)
            self._made.append((time.monotonic(), self.head))
            self.version += 1
        now = time.monotonic()
        if not self._over and (self._node.end or now > self._looked + _LOOK_SEC):
            self._looked = now
            if self._node.end or all(one.domain != self._system.domain for one in running_systems()):
                self._end()

    def _end(self) -> None:
        self._over = True
        told = f"the run has ended; look through it: dcmg page {self._system.out}/bag"
        self.board.say(max(0, self.head - 1), "note", told)
        self.version += 1
