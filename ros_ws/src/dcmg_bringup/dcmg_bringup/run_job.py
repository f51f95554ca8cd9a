"""`dcmg run`: starts the node processes of a scenario, follows them, and brings them all down again."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dcmg_nodes.pacing import PacingMode

from dcmg_bringup.domain import choose_domain
from dcmg_bringup.processes import ProcessGroup

if TYPE_CHECKING:
    from pathlib import Path

    from dcmg_msgs.msg import Alarm
    from dcmg_nodes.view_node import ViewNode
    from dcmg_nodes.wiring import Wiring
    from dgu_sim.scenario import Scenario

    from dcmg_bringup.live import LiveDisplay

_SPIN_SEC = 0.05
_EXIT_GRACE_SEC = 5.0
_ALL = "all"


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """How a scenario is run over ROS 2.

    Attributes:
        pacing: when the clock releases a step.
        rate: realtime factor.
        composed: all nodes in one process instead of one process a node.
        domain: ROS domain id, None: the first free one.
    """

    pacing: PacingMode = PacingMode.LOCKSTEP
    rate: float = 1.0
    composed: bool = False
    domain: int | None = None


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
    """

    bag: Path
    steps: int
    lost: int
    deadline_misses: int
    failure: str | None
    interrupted: bool


def run_job(scenario: Scenario, out: Path, options: RunOptions, display: LiveDisplay) -> RunOutcome:
    """Run a scenario as ROS 2 nodes; every process is gone when this returns.

    Raises:
        DomainError: no ROS domain id is free.
    """
    out.mkdir(parents=True, exist_ok=True)
    path = out / "scenario.yaml"
    path.write_text(scenario.to_yaml())
    with choose_domain(options.domain, scenario=scenario.name, out=str(out)) as domain:
        environment = ros_environment(domain)
        os.environ.update(environment)
        from dcmg_nodes.main import BAG, SUPERVISED, wiring_of  # noqa: PLC0415 (rclpy only when needed)

        wiring = wiring_of(scenario)
        group = ProcessGroup(_commands(wiring, path, out, options), {**environment, SUPERVISED: "1"}, out / "log")
        try:
            return _follow(wiring, group, out / BAG, display)
        finally:
            group.stop()


def ros_environment(domain: int) -> dict[str, str]:
    """Return the environment variables of every process of a run.

    UDP alone is as fast here as Fast DDS's default mix and leaves nothing behind in /dev/shm when a node is killed.
    """
    return {
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
        "OPENBLAS_NUM_THREADS": "1",
    }


def _commands(wiring: Wiring, scenario: Path, out: Path, options: RunOptions) -> dict[str, list[str]]:
    common = ["--scenario", str(scenario), "--out", str(out)]
    common += ["--pacing", options.pacing.value, "--rate", repr(options.rate)]
    if options.composed:
        return {_ALL: [*wiring.nodes, *common]}
    return {name: [name, *common] for name in wiring.nodes}


def _follow(wiring: Wiring, group: ProcessGroup, bag: Path, display: LiveDisplay) -> RunOutcome:
    from dcmg_nodes.view_node import ViewNode  # noqa: PLC0415 (needs the ROS environment of this run)

    def on_alarm(alarm: Alarm) -> None:
        if alarm.active:
            seconds = alarm.header.stamp.sec + alarm.header.stamp.nanosec * 1e-9
            display.alarm(f"t = {seconds:7.2f} s  alarm on link {alarm.source}-{alarm.monitor}")

    alarms = [topic.name for topic in wiring.topics.all if topic.type_name == "dcmg_msgs/msg/Alarm"]
    view = ViewNode(alarms, on_alarm)
    failure, interrupted = None, False
    try:
        while view.end is None and failure is None:
            view.spin(_SPIN_SEC)
            display.steps(view.progress.steps)
            failure = _failure(view, group)
            if failure is None and group.wait(0.0):
                break
        if failure is None:
            group.wait(_EXIT_GRACE_SEC)
    except KeyboardInterrupt:
        interrupted = True
    finally:
        group.stop()
        steps = view.progress.steps if view.end is None else view.end.steps
        display.steps(steps)
        view.close()
    return RunOutcome(
        bag=bag,
        steps=steps,
        lost=0 if view.end is None else view.end.lost,
        deadline_misses=view.pacing.deadline_misses,
        failure=failure,
        interrupted=interrupted,
    )


def _failure(view: ViewNode, group: ProcessGroup) -> str | None:
    step = view.progress.steps
    death = group.death()
    if death is not None:
        return f"node {death.process} ended at step {step} ({death.reason})"
    if view.progress.waiting_for:
        return f"the run stalled: step {step} waits for node {view.progress.waiting_for} ({view.progress.topic})"
    return None
