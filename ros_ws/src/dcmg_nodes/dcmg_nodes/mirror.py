"""What outsiders may listen to: topics of a run, repeated in its public domain as soon as somebody subscribes.

The run's own publishers never meet an outside reader: one that is slow, stopped or gone costs the run nothing but the
repeating of its topics, in a process of its own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rclpy.impl.implementation_singleton import rclpy_implementation

from dcmg_nodes.outside import EARS_NODE
from dcmg_nodes.ports import message_class
from dcmg_nodes.wiring import END

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rclpy.duration import Duration
    from rclpy.node import Node
    from rclpy.publisher import Publisher

    from dcmg_nodes.public import PublicTopic

_LOOK_SEC = 0.2
_LOG_EVERY_SEC = 10.0


class Mirror:
    """A publisher for each topic, under the name of the node that publishes it in the run.

    Args:
        inner: node in the run's own domain.
        faces: nodes in the public domain, by their names in the run.
        topics: of the run.
    """

    def __init__(self, inner: Node, faces: Mapping[str, Node], topics: Sequence[PublicTopic]) -> None:
        """Create the publishers; nothing is subscribed to yet."""
        self._waiting = {
            topic.name: _Door(
                inner,
                topic,
                faces[topic.publisher].create_publisher(message_class(topic.type_name), topic.name, topic.qos),
            )
            for topic in topics
        }
        self._open: list[_Door] = []
        self._node = next(iter(faces.values()))
        self._timer = inner.create_timer(_LOOK_SEC, self._look)

    def settle(self, at_most: Duration) -> None:
        """Wait for whoever follows the end of the run to have heard it."""
        for door in self._open:
            if door.name == END:
                door.settle(at_most)

    def _look(self) -> None:
        """Open what somebody has subscribed to."""
        for name, door in list(self._waiting.items()):
            if door.listeners and self._is_wanted(name):
                door.open()
                self._open.append(self._waiting.pop(name))

    def _is_wanted(self, topic: str) -> bool:
        """Whether somebody but the ears of another run's gate listens."""
        return any(end.node_name != EARS_NODE for end in self._node.get_subscriptions_info_by_topic(topic))


class _Door:
    """One topic: from the run outward, never inward."""

    def __init__(self, inner: Node, topic: PublicTopic, publisher: Publisher) -> None:
        self._inner, self._topic, self._publisher = inner, topic, publisher
        self._failed = 0
        self.name = topic.name

    @property
    def listeners(self) -> int:
        """Outside subscriptions that are matched."""
        return int(self._publisher.get_subscription_count())

    def open(self) -> None:
        """Repeat every message from now on; of a latched topic, those before, too."""
        kind = message_class(self._topic.type_name)
        self._subscription = self._inner.create_subscription(kind, self.name, self._repeat, self._topic.qos, raw=True)

    def settle(self, at_most: Duration) -> None:
        """Wait until what was repeated has arrived."""
        self._publisher.wait_for_all_acked(at_most)

    def _repeat(self, data: bytes) -> None:
        try:
            self._publisher.publish(data)
        except rclpy_implementation.RCLError as error:
            self._failed += 1
            said = f"{self.name}: {self._failed} message(s) could not be repeated for outsiders: {error}"
            self._inner.get_logger().warning(said, throttle_duration_sec=_LOG_EVERY_SEC)
