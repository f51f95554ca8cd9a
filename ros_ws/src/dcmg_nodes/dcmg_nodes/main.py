"""Builds the named nodes of a run in this process and spins them until the run ends: what `dcmg node` does."""

from __future__ import annotations

import os
import signal
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from bags.mcap.writer import open_recording
from bags.watch.carried import read_carried
from bags.watch.designs import Told
from bags.watch.histories import grid_history_of_run, histories_of_run, recorded_states
from bags.wire.origin import attach_origin, host_facts
from bags.wire.schema import ATTACKER_NODE, CLOCK_NODE, dgu_name, monitor_name
from bags.wire.settings import settings_of
from dcmg_nodes.attacker_node import AttackerNode
from dcmg_nodes.clock_node import ClockConfig, ClockNode
from dcmg_nodes.companions import Companions, Patience, taken_names
from dcmg_nodes.dgu_node import DguConfig, DguNode
from dcmg_nodes.errors import NodeError
from dcmg_nodes.executor import make_executor, spin_until
from dcmg_nodes.farewell import destroy
from dcmg_nodes.host import host_of
from dcmg_nodes.monitor_node import MonitorConfig, MonitorNode
from dcmg_nodes.options import BAG, NodeOptions
from dcmg_nodes.recorder_node import RecorderNode
from dcmg_nodes.ros_arguments import ros_arguments
from dcmg_nodes.wiring import RECORDER_NODE, Wiring, wiring_of
from dgu_sim.settings import Accept
from dgu_sim.simulate import relay_of
from dgu_sim.unit import unit_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dcmg_nodes.host import Host
    from dcmg_nodes.ports import Ports
    from dgu_sim.scenario import Scenario

_SIGNAL_CHECK_SEC = 0.1
_STALL_PERIODS = 5


def run_nodes(names: Sequence[str], scenario: Scenario, options: NodeOptions) -> str | None:
    """Run the named nodes until the run ends.

    Returns:
        A sentence when the run failed, None when it ended well or was interrupted.

    Raises:
        NodeError: the scenario has no such node.
    """
    wiring = wiring_of(scenario)
    if options.run:
        wiring = replace(wiring, run=options.run)
    for name in names:
        if name not in wiring.nodes:
            raise NodeError(f"{name}: no such node; scenario {scenario.name} has {', '.join(wiring.nodes)}")
    host = host_of(tuple(names), alone=options.alone)
    # A KeyboardInterrupt could hit in the middle of a step: take signals between callbacks instead.
    rclpy.init(args=ros_arguments(), signal_handler_options=SignalHandlerOptions.NO)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: host.lifetime.interrupt())
    try:
        with ExitStack() as stack:
            if options.alone:
                _check_free(names)
            builder = _Builder(scenario, options, wiring, host, stack)
            ports = [builder.build(name) for name in names]
            executor = make_executor(options.executor, ports[0].node)
            stack.callback(executor.shutdown)
            for other in ports[1:]:
                executor.add_node(other.node)
            ports[0].node.create_timer(_SIGNAL_CHECK_SEC, lambda: None)  # Python sees signals between callbacks only
            host.bus.attach(executor)
            if options.alone:
                _companions = Companions(ports, wiring, host.lifetime, _patience(scenario, options))
            spin_until(executor, host.lifetime.over)
    finally:
        rclpy.try_shutdown()
    return host.lifetime.failure


def _check_free(names: Sequence[str]) -> None:
    """See that the nodes are not there already.

    Raises:
        NodeError: they are.
    """
    probe = Node(f"probe_{os.getpid()}", enable_rosout=False, start_parameter_services=False)
    try:
        taken = taken_names(probe, names)
    finally:
        destroy(probe, 1)
    if taken:
        raise NodeError(f"{', '.join(taken)}: in this ROS domain already, of another run? Set another ROS_DOMAIN_ID")


def _patience(scenario: Scenario, options: NodeOptions) -> Patience:
    period_sec = scenario.sampling_period_sec / options.rate
    stall_sec = max(options.stall_timeout_sec, _STALL_PERIODS * period_sec)
    return Patience(start_sec=options.start_timeout_sec, stall_sec=stall_sec)


class _Builder:
    """Turns a node name into a node."""

    def __init__(self, scenario: Scenario, options: NodeOptions, wiring: Wiring, host: Host, stack: ExitStack) -> None:
        self._scenario, self._options, self._wiring = scenario, options, wiring
        self._settings = settings_of(scenario)
        self._host, self._stack = host, stack
        self._makers: dict[str, Callable[[], Ports]] = {
            CLOCK_NODE: self._clock,
            ATTACKER_NODE: self._attacker,
            RECORDER_NODE: self._recorder,
            **{dgu_name(dgu): partial(self._dgu, dgu) for dgu in wiring.topics.dgus},
            **{monitor_name(dgu): partial(self._monitor, dgu) for dgu in wiring.topics.dgus},
        }

    def build(self, name: str) -> Ports:
        """Make the node and have it destroyed when the process ends."""
        ports = self._makers[name]()
        self._stack.callback(self._destroy, ports)
        return ports

    def _destroy(self, ports: Ports) -> None:
        destroy(ports.node, 0 if self._host.lifetime.failure is None else 1)

    def _clock(self) -> Ports:
        config = ClockConfig(
            steps=self._scenario.steps,
            period_ns=self._scenario.sampling_period_ns,
            mode=self._options.pacing,
            rate=self._options.rate,
            start_timeout_sec=self._options.start_timeout_sec,
        )
        return ClockNode(self._wiring, self._host, config).ports

    def _dgu(self, dgu: int) -> Ports:
        unit = unit_of(self._scenario, dgu)
        history = histories_of_run(self._scenario, dgu)
        config = DguConfig(steps=self._scenario.steps, newest=self._scenario.receiver.accept is Accept.NEWEST)
        node = DguNode(self._wiring, self._host, unit, history, config)
        if node.announcer is not None and dgu == self._wiring.topics.dgus[0]:
            node.announcer.publish_history(grid_history_of_run(self._scenario))
        return node.ports

    def _attacker(self) -> Ports:
        relay, state = relay_of(
            self._scenario, recorded=recorded_states(self._scenario), ready_sec=self._settings.calibrated_sec
        )
        return AttackerNode(self._wiring, self._host, relay, state, self._scenario.steps).ports

    def _monitor(self, dgu: int) -> Ports:
        designs = self._options.designs
        config = MonitorConfig(
            told=Told(self._settings, None if designs is None else read_carried(designs)),
            steps=self._scenario.steps,
            newest=self._scenario.receiver.accept is Accept.NEWEST,
        )
        return MonitorNode(self._wiring, self._host, dgu, config).ports

    def _recorder(self) -> Ports:
        writer = open_recording(self._options.out / BAG, self._wiring.topics.all, self._options.recording)
        attach_origin(writer, self._scenario, host_facts(), by_hand=True)
        stall_sec = _patience(self._scenario, self._options).stall_sec
        node = RecorderNode(self._wiring, self._host, writer, self._scenario.steps, stall_sec)
        self._stack.callback(node.close)
        return node.ports
