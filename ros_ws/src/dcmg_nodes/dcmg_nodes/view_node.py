"""A bystander that follows a run through its run-control topics and alarms, for display and supervision."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import rclpy
from dcmg_msgs.msg import Alarm, Pacing, Progress, RunEnd
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from dcmg_nodes.farewell import destroy
from dcmg_nodes.ports import CONTROL_QOS
from dcmg_nodes.ros_arguments import ros_arguments
from dcmg_nodes.wiring import END, PACING, PROGRESS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

_ALARM_QOS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)


class ViewNode:
    """Keeps the newest progress, pacing and end of a run.

    Args:
        alarm_topics: topics of `dcmg_msgs/Alarm` to follow.
        on_alarm: called with the topic and every alarm message on it.
    """

    def __init__(self, alarm_topics: Iterable[str], on_alarm: Callable[[str, Alarm], None]) -> None:
        """Create a rclpy context of our own, so that a view never disturbs other nodes of the process."""
        self.progress = Progress()
        self.pacing = Pacing()
        self.end: RunEnd | None = None
        self._context = rclpy.Context()
        self._context.init(args=ros_arguments())
        self._node = Node("dcmg_view", context=self._context, enable_rosout=False, start_parameter_services=False)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        create = self._node.create_subscription
        self._subscriptions = [
            create(Progress, PROGRESS, self._on_progress, CONTROL_QOS),
            create(Pacing, PACING, self._on_pacing, CONTROL_QOS),
            create(RunEnd, END, self._on_end, CONTROL_QOS),
            *(create(Alarm, topic, partial(on_alarm, topic), _ALARM_QOS) for topic in alarm_topics),
        ]

    def spin(self, duration_sec: float) -> None:
        """Dispatch what arrives within `duration_sec`."""
        self._executor.spin_once(timeout_sec=duration_sec)

    def close(self) -> None:
        """Leave the ROS graph; a second call does nothing."""
        if not self._context.ok():
            return
        self._executor.shutdown()
        destroy(self._node, 1)
        self._context.try_shutdown()

    def _on_progress(self, message: Progress) -> None:
        self.progress = message

    def _on_pacing(self, message: Pacing) -> None:
        self.pacing = message

    def _on_end(self, message: RunEnd) -> None:
        self.end = message
