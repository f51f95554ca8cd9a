"""`dcmg run`: starts the node processes of a scenario, follows them, and brings them all down again."""

from __future__ import annotations

import os
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Protocol

from bags.mcap.container import open_container
from bags.mcap.errors import BagError
from bags.mcap.recording import Recording
from bags.mcap.repair import repair
from dcmg_bringup.domain import choose_domain, inner_domain
from dcmg_bringup.hosts.fleet import FleetGroup, fleet_of, write_designs
from dcmg_bringup.hosts.hosts_file import HERE
from dcmg_bringup.hosts.profile import LOOPBACK, write_profile
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
    from dcmg_bringup.hosts.fleet import Fleet
    from dcmg_bringup.hosts.hosts_file import HostsFile
    from dcmg_bringup.watchdog import Group
    from dcmg_nodes.wiring import Wiring
    from dgu_sim.scenario import Scenario

_SPIN_SEC = 0.05
_EXIT_GRACE_SEC = 5.0
_PERIODS = 12  # longer than a recorder waits for a step, however slow the clock
_ALL = "all"
_PROFILE = "FASTRTPS_DEFAULT_PROFILES_FILE"
DESIGNS = "designs"  # folder of the bag of designs that several hosts share


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
        hosts: the other machines, None: all nodes run on this one.
        hosts_source: the file that says so, for messages.
    """

    pacing: PacingMode = PacingMode.LOCKSTEP
    rate: float = 1.0
    composed: bool = False
    domain: int | None = None
    recording: Recording = field(default_factory=Recording)
    designs: Path | None = None
    page: bool = False
    hosts: HostsFile | None = None
    hosts_source: str = ""


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
        ScenarioError: the scenario has a script.
        HostsError: one of several hosts cannot take part.
    """
    wiring = wiring_of(scenario)
    with ExitStack() as stack:
        fleet = None
        if options.hosts is not None:
            fleet = stack.enter_context(fleet_of(options.hosts, scenario, options.hosts_source))
        out.mkdir(parents=True, exist_ok=True)
        (out / "scenario.yaml").write_text(scenario.to_yaml())
        domain = stack.enter_context(choose_domain(options.domain, scenario=scenario.name, out=str(out.resolve())))
        inner = stack.enter_context(inner_domain(domain, () if fleet is None else fleet.taken))
        os.environ.update(ros_environment(inner))
        display.say(f"other ROS programs join this run after: export ROS_DOMAIN_ID={domain}")
        wiring.warm_up()
        gate = GateOptions(inner=inner, public=domain, folder=out / STRANGERS)
        node_options = NodeOptions(
            out=out,
            pacing=options.pacing,
            rate=options.rate,
            recording=options.recording,
            designs=options.designs,
        )
        if fleet is not None:
            node_options = replace(node_options, designs=write_designs(scenario, options.designs, out / DESIGNS))
            gate = _among_hosts(fleet, gate, out)
            fleet.offer(scenario, node_options, inner, composed=options.composed)
        here = wiring.nodes if fleet is None else fleet.here
        nodes = {_ALL: here} if options.composed else {name: (name,) for name in here}
        told = stack.enter_context(interruptions())
        if options.page:
            stack.enter_context(page_beside(domain))
        local = ProcessGroup(nodes, scenario, node_options, out / "log", gate)
        try:
            group: Group = local if fleet is None else FleetGroup(local, fleet, out)
            watchdog = Watchdog(group, _silence_sec(scenario, node_options))
            outcome = _follow(wiring, group, watchdog, out=out, display=display, told=told)
        finally:
            local.stop()
        if fleet is not None and options.pacing is PacingMode.REALTIME:
            for line in fleet.offsets():
                display.say(line)
        return outcome


def _among_hosts(fleet: Fleet, gate: GateOptions, out: Path) -> GateOptions:
    """Write the Fast DDS profiles of this host of several; the gate alone uses the loopback interface, too."""
    own = fleet.addresses[HERE]
    os.environ[_PROFILE] = str(write_profile(out / "fastdds.xml", "fastdds.xml", [own], fleet.peers))
    interfaces = list(dict.fromkeys((LOOPBACK, own)))
    profile = write_profile(out / "fastdds_gate.xml", "gate.xml", interfaces, [LOOPBACK])
    return replace(gate, profile=profile, peers=fleet.peers)


def _silence_sec(scenario: Scenario, options: NodeOptions) -> float:
    """How long a run may be silent [s]: longer than its clock waits at the start, and its recorder for a step."""
    waits = max(options.start_timeout_sec, options.stall_timeout_sec)
    return waits + _PERIODS * scenario.sampling_period_sec / options.rate


def _follow(
    wiring: Wiring, group: Group, watchdog: Watchdog, *, out: Path, display: Display, told: Sequence[int]
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
        failure = f"the run stalled: step {steps} waits for node {waiting_for}{group.where(waiting_for)} ({topic})"
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
