"""The ROS side of one node: raw bytes in and out, counted, and known to be matched before step 0.

Payloads cross as the CDR bytes of `bags.schema`, so what is on the wire is what is in the bag, and no per-message
Python object is built. Run control (`/run/*`) uses ordinary typed messages.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from bags.qos import Durability
from dcmg_msgs.msg import NodeDone, Ready, RunEnd
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from dcmg_nodes.wiring import DONE, END, READY, RECORDER_NODE, Wiring

if TYPE_CHECKING:
    from collections.abc import Callable

    from bags.topic import Topic
    from dcmg_nodes.lifetime import Lifetime
    from rclpy.publisher import Publisher
    from rclpy.subscription import Subscription

MATCH_POLL_SEC = 0.02
CONTROL_QOS = QoSProfile(
    history=HistoryPolicy.KEEP_ALL,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)


def message_class(type_name: str) -> Any:  # noqa: ANN401 (generated message classes share no base)
    """Return the generated class of a type name such as `dcmg_msgs/msg/State`."""
    package, kind, name = type_name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), name)


class Ports:
    """Topics of one node.

    Args:
        name: node name.
        wiring: static graph of the run.
        lifetime: of the process; the node leaves it at the end of the run.
    """

    def __init__(self, name: str, wiring: Wiring, lifetime: Lifetime) -> None:
        """Create the rclpy node, its data publishers and its run-control topics."""
        self.name = name
        self.lifetime = lifetime
        self.wiring = wiring
        # Parameter services and /rosout would triple the endpoints that every peer has to discover.
        self.node = Node(name, enable_rosout=False, start_parameter_services=False)
        self.log = self.node.get_logger()
        self.counts: dict[str, int] = {}
        self._publishers: dict[str, Publisher[Any]] = {}
        self._subscriptions: dict[str, Subscription[Any]] = {}
        for topic in wiring.topics.published_by(name):
            qos = data_qos(topic)
            self._publishers[topic.name] = self.node.create_publisher(message_class(topic.type_name), topic.name, qos)
            self.counts[topic.name] = 0
        self._ready = self.node.create_publisher(Ready, READY, CONTROL_QOS)
        self._done = self.node.create_publisher(NodeDone, DONE, CONTROL_QOS)
        if name != RECORDER_NODE:
            self._end = self.node.create_subscription(RunEnd, END, self._on_end, CONTROL_QOS)
        self._prepared: Callable[[], bool] = lambda: True
        self._timer = self.node.create_timer(MATCH_POLL_SEC, self._announce_when_matched)

    def publish(self, topic: str, data: bytes) -> None:
        """Put the CDR bytes of one message on the wire."""
        self._publishers[topic].publish(data)
        self.counts[topic] += 1

    def subscribe(self, topic: Topic, on_bytes: Callable[[bytes], object]) -> None:
        """Call `on_bytes` with the CDR bytes of every message of a recorded topic."""
        self._subscriptions[topic.name] = self.node.create_subscription(
            message_class(topic.type_name), topic.name, on_bytes, data_qos(topic), raw=True
        )

    def ready_when(self, prepared: Callable[[], bool]) -> None:
        """Announce readiness only once `prepared()` holds too."""
        self._prepared = prepared

    def unmatched(self) -> list[str]:
        """Describe each topic whose other side is not there yet."""
        topics = {topic.name: topic for topic in self.wiring.topics.all}
        late = []
        for name, publisher in self._publishers.items():
            missing = len(self.wiring.readers(topics[name])) - publisher.get_subscription_count()
            if missing > 0:
                late.append(f"{name} lacks {missing} subscriber(s)")
        for name, subscription in self._subscriptions.items():
            missing = len(topics[name].publishers) - subscription.get_publisher_count()
            if missing > 0:
                late.append(f"{name} lacks {missing} publisher(s)")
        if not self._ready.get_subscription_count():
            late.append(f"{READY} lacks the clock")
        if not self._done.get_subscription_count():
            late.append(f"{DONE} lacks the recorder")
        return late

    def finish(self) -> None:
        """Tell the recorder that this node has published its last message."""
        self._done.publish(NodeDone(node=self.name, topics=list(self.counts), counts=list(self.counts.values())))

    def _announce_when_matched(self) -> None:
        if self._prepared() and not self.unmatched():
            self.node.destroy_timer(self._timer)
            self._ready.publish(Ready(node=self.name))

    def _on_end(self, _message: RunEnd) -> None:
        self.lifetime.leave(self.name)


def data_qos(topic: Topic) -> QoSProfile:
    """Return the QoS profile under which a recorded topic is published and read."""
    latched = topic.qos.durability is Durability.TRANSIENT_LOCAL
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=topic.qos.depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
