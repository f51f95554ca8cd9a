"""`dcmg run`: starts the node processes of a scenario, follows them, and brings them all down again."""

from __future__ import annotations

import os
from contextlib import nullcontext
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

from bags.mcap.container import open_container
from bags.mcap.errors import BagError
from bags.mcap.recording import Recording
from bags.mcap.repair import repair
from dcmg_bringup.domain import choose_domain, inner_domain
from dcmg_bringup.interruptions import interruptions
from dcmg_bringup.page_command import page_beside
from dcmg_bringup.processes import ProcessGroup
from dcmg_bringup.ros_environment import ros_environment
from dcmg_bringup.strangers import Strangers
from dcmg_bringup.watchdog import Watchdog
from dcmg_nodes.options import BAG, STRANGERS, GateOptions, NodeOptions, PacingMode
from dcmg_nodes.wiring import wiring_of

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from dcmg_msgs.msg import Alarm

    from dcmg.strangers import StrangeTopic
    from dcmg_nodes.wiring import Wiring
    from dgu_sim.scenario import Scenario

_SPIN_SEC = 0.05
_EXIT_GRACE_SEC = 5.0
_PERIODS = 12  # longer than a recorder waits for a step, however slow the clock
_ALL = "all"


class Display(Protocol):
    """Where the progress of a run is shown."""

    def steps(self, complete: int) -> None:
        """Show that all steps below `complete` are recorded."""

    def alarm(self, line: str) -> None:
        """Show an alarm."""

    def say(self, line: str) -> None:
        """Show any other line."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """How a scenario is run over ROS 2.

    Attributes:
        pacing: when the clock releases a step.
        rate: realtime factor.
        composed: all nodes in one process instead of one process a node.
        domain: ROS domain id, None: the first free one.
        recording: how the bag is written.
        designs: bag with designs that the monitors take where they fit, None: they design everything.
        page: whether a page shows the run in a browser.
    """

    pacing: PacingMode = PacingMode.LOCKSTEP
    rate: float = 1.0
    composed: bool = False
    domain: int | None = None
    recording: Recording = field(default_factory=Recording)
    designs: Path | None = None
    page: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOutcome:
    """How a run ended.

    Attributes:
        bag: path of the bag.
        steps: number of complete steps in it.
        lost: messages that were published and did not arrive.
        deadline_misses: ticks released more than a sampling period late (realtime pacing).
        failure: one line when the run failed, naming node and step.
        interrupted: Ctrl-C ended it.
        strangers: what was said on its topics by others, and set aside.
    """

    bag: Path
    steps: int
    lost: int
    deadline_misses: int
    failure: str | None
    interrupted: bool
    strangers: Sequence[StrangeTopic] = ()


def run_job(scenario: Scenario, out: Path, options: RunOptions, display: Display) -> RunOutcome:
    """Run a scenario as ROS 2 nodes; every process is gone when this returns.

    Raises:
        DomainError: no ROS domain id is free.
    """
    out.mkdir(parents=True, exist_ok=True)
    (out / "scenario.yaml").write_text(scenario.to_yaml())
    with (
        choose_domain(options.domain, scenario=scenario.name, out=str(out.resolve())) as domain,
        inner_domain(public=domain) as inner,
    ):
        os.environ.update(ros_environment(inner))
        display.say(f"other ROS programs join this run after: export ROS_DOMAIN_ID={domain}")
        wiring = wiring_of(scenario)
        wiring.warm_up()
        nodes = {_ALL: wiring.nodes} if options.composed else {name: (name,) for name in wiring.nodes}
        node_options = NodeOptions(
            out=out,
            pacing=options.pacing,
            rate=options.rate,
            recording=options.recording,
            designs=options.designs,
        )
        gate = GateOptions(inner=inner, public=domain, folder=out / STRANGERS)
        with interruptions() as told, page_beside(domain) if options.page else nullcontext():
            group = ProcessGroup(nodes, scenario, node_options, out / "log", gate)
            try:
                watchdog = Watchdog(group, _silence_sec(scenario, node_options))
                return _follow(wiring, group, watchdog, out=out, display=display, told=told)
            finally:
                group.stop()


def _silence_sec(scenario: Scenario, options: NodeOptions) -> float:
    """How long a run may be silent [s]: longer than its clock waits at the start, and its recorder for a step."""
    waits = max(options.start_timeout_sec, options.stall_timeout_sec)
    return waits + _PERIODS * scenario.sampling_period_sec / options.rate


def _follow(
    wiring: Wiring, group: ProcessGroup, watchdog: Watchdog, *, out: Path, display: Display, told: Sequence[int]
) -> RunOutcome:
    from dcmg_nodes.view_node import ViewNode  # noqa: PLC0415 (needs the ROS environment of this run)

    accusations = {wiring.topics.accusations(dgu).topic.name for dgu in wiring.topics.dgus}

    def on_alarm(topic: str, alarm: Alarm) -> None:
        if alarm.active:
            seconds = alarm.header.stamp.sec + alarm.header.stamp.nanosec * 1e-9
            display.alarm(f"t = {seconds:7.2f} s  {_in_words(alarm, by_team=topic in accusations)}")

    alarms = [topic.name for topic in wiring.topics.all if topic.type_name == "dcmg_msgs/msg/Alarm"]
    view = ViewNode(alarms, on_alarm)
    strangers = Strangers(out / STRANGERS, display.say)
    trouble, stalled = None, False
    try:
        while not (view.end or trouble or stalled or told):
            view.spin(_SPIN_SEC)
            display.steps(view.progress.steps)
            strangers.look()
            trouble, stalled = watchdog.look(view.progress.steps), bool(view.progress.waiting_for)
            if trouble is None and group.has_ended():
                break  # all have ended well; the news of the end can be lost with the recorder that told it
        if not told:
            view.close()  # the recorder waits until nobody listens to the end of the run
        if not (trouble or stalled or told):
            group.wait(_EXIT_GRACE_SEC)
    finally:
        group.stop()
        view.close()
    strangers.look()
    bag = out / BAG
    steps = _recorded_steps(bag, wiring)
    display.steps(steps)
    failure = None
    if trouble is not None:
        failure = trouble.at(steps)
    elif stalled:
        waiting_for, topic = view.progress.waiting_for, view.progress.topic
        failure = f"the run stalled: step {steps} waits for node {waiting_for} ({topic})"
    return RunOutcome(
        bag=bag,
        steps=steps,
        lost=0 if view.end is None else view.end.lost,
        deadline_misses=view.pacing.deadline_misses,
        failure=failure,
        interrupted=bool(told),
        strangers=strangers.topics,
    )


def _in_words(alarm: Alarm, *, by_team: bool) -> str:
    if by_team:
        return f"member {alarm.monitor} of the team accuses member {alarm.source}"
    own = alarm.source == alarm.monitor
    return f"alarm in the own state of DGU {alarm.monitor}" if own else f"alarm on link {alarm.source}-{alarm.monitor}"


def _recorded_steps(bag: Path, wiring: Wiring) -> int:
    """Count the complete steps in a bag; one that a killed recorder left open is repaired in its place."""
    if not bag.exists():
        return 0
    try:
        counts = open_container(bag).counts
    except BagError:
        broken = bag.with_name(f"{bag.name}_as_left_by_the_recorder")
        bag.rename(broken)
        repair(broken, bag)
        counts = open_container(bag).counts
    # a topic that was not to be recorded does not count
    return min((counts[topic.name] for topic in wiring.topics.per_step if topic.name in counts), default=0)
