"""Spins the monitors of foreign topics until they are interrupted, done or fail: what `dcmg monitor` does."""

from __future__ import annotations

import signal
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING

import rclpy
from rclpy.signals import SignalHandlerOptions

from bags.foreign.importing import attach_mapping
from bags.mcap.writer import BagWriter
from dcmg_nodes.errors import NodeError
from dcmg_nodes.executor import make_executor, spin_until
from dcmg_nodes.farewell import destroy
from dcmg_nodes.foreign_monitor_node import NAME, ForeignConfig, ForeignMonitorNode
from dcmg_nodes.lifetime import Lifetime
from dcmg_nodes.options import ExecutorKind
from dcmg_nodes.ros_arguments import ros_arguments

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from bags.foreign.mapping import Mapping as ForeignMapping
    from bags.foreign.stream_monitors import StreamMonitors

_SIGNAL_CHECK_SEC = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class ForeignOutcome:
    """What monitoring foreign topics came to.

    Attributes:
        steps: samples taken.
        alarms: alarms that started.
        missing: samples that did not come, or not as finite numbers, on all links together.
        not_finite: by field, how many samples came that are no finite numbers.
        late: messages dropped because they came too late or out of order.
        irregular: messages at no instant of the grid, which count as missing.
        restarts: how often the stamps jumped.
    """

    steps: int
    alarms: int
    missing: int
    not_finite: Mapping[str, int]
    late: int
    irregular: int
    restarts: int


def watch_foreign_topics(
    mapping: ForeignMapping,
    monitors: StreamMonitors,
    *,
    wait_sec: float,
    steps: int | None,
    out: Path | None,
    say: Callable[[str], None],
) -> ForeignOutcome:
    """Monitor until Ctrl-C, the last step, or a failure; a bag is closed in any case.

    Args:
        mapping: which numbers of which topics are what.
        monitors: designed for it.
        wait_sec: how long the topics are waited for [s].
        steps: samples after which to end, None: never.
        out: bag to record, None: none.
        say: called with every line that a person should read.

    Raises:
        NodeError: a topic, type or field is missing.
        BagError: the bag cannot be written.
    """
    lifetime = Lifetime((NAME,))
    rclpy.init(args=ros_arguments(), signal_handler_options=SignalHandlerOptions.NO)
    try:
        with ExitStack() as stack:
            for number in (signal.SIGINT, signal.SIGTERM):
                before = signal.signal(number, lambda *_: lifetime.interrupt())
                stack.callback(signal.signal, number, before)
            writer = None if out is None else stack.enter_context(_writer(out, mapping, monitors))
            config = ForeignConfig(
                mapping=mapping, monitors=monitors, wait_sec=wait_sec, steps=steps, writer=writer, say=say
            )
            node = ForeignMonitorNode(config, lifetime)
            stack.callback(destroy, node.node, 1)
            executor = make_executor(ExecutorKind.EVENTS, node.node)
            stack.callback(executor.shutdown)
            node.node.create_timer(_SIGNAL_CHECK_SEC, lambda: None)  # Python sees signals between callbacks only
            spin_until(executor, lifetime.over)
    finally:
        rclpy.try_shutdown()
    if lifetime.failure is not None:
        raise NodeError(lifetime.failure.removeprefix(f"{NAME}: "))
    sampler = node.intake.state.sampler
    return ForeignOutcome(
        steps=node.step,
        alarms=node.alarms,
        missing=node.missing,
        not_finite=node.not_finite,
        late=sampler.late if sampler else 0,
        irregular=sampler.irregular if sampler else 0,
        restarts=node.intake.state.restarts,
    )


def _writer(out: Path, mapping: ForeignMapping, monitors: StreamMonitors) -> BagWriter:
    """Open a bag with the histories and the mapping in it."""
    topics = monitors.topics
    histories = {one.dgu: topics.history(one.dgu) for one in monitors.histories}
    residuals = [topics.residual(link).topic for link in topics.links]
    recorded = {topic.name for topic in (*topics.heard, *residuals)}
    skipped = {topic.name for topic in topics.per_step if topic.name not in recorded}
    skipped |= {topics.attack_events().topic.name}
    skipped |= {topics.history(dgu).topic.name for dgu in topics.dgus if dgu not in histories}
    writer = BagWriter(out, [topic for topic in topics.all if topic.name not in skipped])
    attach_mapping(writer, mapping)
    for record in monitors.histories:
        codec = histories[record.dgu]
        writer.write(codec.topic.name, 0, codec.encode(record))
    return writer
