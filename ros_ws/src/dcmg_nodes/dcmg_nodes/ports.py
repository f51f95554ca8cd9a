"""The ROS side of one node: raw bytes in and out, counted, and known to be matched before step 0.

Payloads cross as the CDR bytes of `bags.wire.schema`, so what is on the wire is what is in the bag, and no per-message
Python object is built. Run control (`/run/*`) uses ordinary typed messages.
"""

from __future__ import annotations

import importlib
import inspect
import time
from functools import partial
from typing import TYPE_CHECKING, Any

from dcmg_msgs.msg import NodeDone, Ready, RunEnd
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from bags.mcap.qos import Durability
from bags.mcap.topic import TopicKind
from bags.wire.schema import SECOND_PUBLISHER
from dcmg_nodes.wiring import DONE, END, READY, RECORDER_NODE, Wiring

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rclpy.publisher import Publisher
    from rclpy.subscription import Subscription

    from bags.mcap.topic import Topic
    from dcmg_nodes.host import Host

MATCH_POLL_SEC = 0.1
_BYSTANDER_POLL_SEC = 0.2
CONTROL_QOS = QoSProfile(  # of readers
    history=HistoryPolicy.KEEP_ALL,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
CONTROL_OUT_QOS = QoSProfile(  # of publishers: a reader that has stopped reading must not hold them up
    history=HistoryPolicy.KEEP_LAST,
    depth=64,
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
        host: the process; the node leaves its lifetime at the end of the run.
    """

    def __init__(self, name: str, wiring: Wiring, host: Host) -> None:
        """Create the rclpy node, its data publishers and its run-control topics."""
        self.name, self.since_ns = name, time.time_ns()
        self.lifetime = host.lifetime
        self._bus, self._alone = host.bus, host.alone
        self._announced = False
        self._strange: set[str] = set()
        self.wiring = wiring
        # Parameter services and /rosout would triple the endpoints that every peer has to discover.
        self.node = Node(name, enable_rosout=False, start_parameter_services=False)
        self.log = self.node.get_logger()
        self.counts: dict[str, int] = {}
        # with the number of peers in other processes that a run has
        self._publishers: dict[str, tuple[Publisher, int]] = {}
        self._subscriptions: dict[str, tuple[Subscription, int]] = {}
        self._over_dds: dict[str, bool] = {}
        self._seconds: dict[str, Publisher] = {}
        for topic in wiring.topics.published_by(name):
            qos = data_qos(topic)
            publisher = self.node.create_publisher(message_class(topic.type_name), topic.name, qos)
            self._publishers[topic.name] = (publisher, self._remote_readers(topic))
            self._over_dds[topic.name] = self._remote_readers(topic) > 0
            self.counts[topic.name] = 0
        self._ready = self.node.create_publisher(Ready, READY, CONTROL_OUT_QOS)
        self._done = self.node.create_publisher(NodeDone, DONE, CONTROL_OUT_QOS)
        if name != RECORDER_NODE:
            self._end = self.node.create_subscription(RunEnd, END, self._on_end, CONTROL_QOS)
        self._per_step = [one.name for one in wiring.topics.per_step if one.name in self.counts]
        self._awaited: Callable[[], Sequence[str]] = tuple
        self._steps: Callable[[], int] | None = None
        self._prepared: Callable[[], bool] = lambda: True
        self._timer = self.node.create_timer(MATCH_POLL_SEC, self._announce_when_matched)
        if not all(self._over_dds.values()):
            self._bystander_timer = self.node.create_timer(_BYSTANDER_POLL_SEC, self._look_for_bystanders)

    def publish(self, topic: str, data: bytes) -> None:
        """Put the CDR bytes of one message on the wire, and to the readers in this process."""
        if self._over_dds[topic]:
            self._publishers[topic][0].publish(data)
        self._bus.send(topic, data)
        self.counts[topic] += 1

    def subscribe(
        self, topic: Topic, on_bytes: Callable[[bytes], None], on_other: Callable[[bytes], None] | None = None
    ) -> None:
        """Call `on_bytes` with the CDR bytes of every message of a recorded topic.

        With `on_other`, only with those of the publisher that was there at step 0, and `on_other` with all others.
        """
        if self._alone and topic.kind is TopicKind.PER_STEP:
            on_bytes, on_other = self._once_announced(on_bytes), on_other or partial(self._set_aside, topic.name)
        if self._is_local(topic):
            self._bus.add_reader(topic.name, on_bytes)
            if on_other is not None:
                self._bus.add_second_reader(topic.name, on_other)
            return
        callback: Any = on_bytes if on_other is None else _Sorted(on_bytes, on_other)
        subscription = self.node.create_subscription(
            message_class(topic.type_name), topic.name, callback, data_qos(topic), raw=True
        )
        self._subscriptions[topic.name] = (subscription, len(topic.publishers))

    def open_second(self, topic: Topic) -> None:
        """Create a second publisher on a topic that the node publishes already."""
        if topic.name not in self._seconds:
            kind, qos = message_class(topic.type_name), data_qos(topic)
            self._seconds[topic.name] = self.node.create_publisher(kind, topic.name, qos)
            self.counts[second_name(topic)] = 0

    def publish_second(self, topic: Topic, data: bytes) -> None:
        """Send the CDR bytes of one message through the second publisher of a topic."""
        self._seconds[topic.name].publish(data)
        self._bus.send_second(topic.name, data)
        self.counts[second_name(topic)] += 1

    def second_is_matched(self, topic: Topic) -> bool:
        """Whether all readers of the run that DDS must reach are there for the second publisher."""
        return bool(self._seconds[topic.name].get_subscription_count() >= self._remote_readers(topic))

    def hears_second(self, topic: Topic) -> bool:
        """Whether this reader is matched with a second publisher of a topic."""
        if topic.name not in self._subscriptions:
            return True
        subscription, publishers = self._subscriptions[topic.name]
        return bool(subscription.get_publisher_count() > publishers)

    def waits_for(self, awaited: Callable[[], Sequence[str]], steps: Callable[[], int] | None = None) -> None:
        """Take what tells the topics whose next message the node's next step needs, and how many steps it has done.

        Without `steps`, what it has published tells that.
        """
        self._awaited, self._steps = awaited, steps

    def awaited(self) -> Sequence[str]:
        """Topics whose next message the node's next step needs; none once it has done all its steps."""
        return self._awaited()

    def progress(self) -> int:
        """A number that grows while the node does something."""
        return sum(self.counts.values()) if self._steps is None else self._steps()

    def has_begun(self) -> bool:
        """Whether the node has taken part in a step."""
        return any(self.counts[name] for name in self._per_step) if self._steps is None else self._steps() > 0

    def ready_when(self, prepared: Callable[[], bool]) -> None:
        """Announce readiness only once `prepared()` holds too."""
        self._prepared = prepared

    def unmatched(self) -> list[str]:
        """Describe each topic whose other side is not there yet."""
        late = []
        for name, (publisher, wanted) in self._publishers.items():
            if (missing := wanted - publisher.get_subscription_count()) > 0:
                late.append(f"{name} lacks {missing} subscriber(s)")
        for name, (subscription, wanted) in self._subscriptions.items():
            if (missing := wanted - subscription.get_publisher_count()) > 0:
                late.append(f"{name} lacks {missing} publisher(s)")
        if not self._ready.get_subscription_count():
            late.append(f"{READY} lacks the clock")
        if not self._done.get_subscription_count():
            late.append(f"{DONE} lacks the recorder")
        return late

    def finish(self) -> None:
        """Tell the recorder that this node has published its last message."""
        self._awaited = tuple
        self._done.publish(NodeDone(node=self.name, topics=list(self.counts), counts=list(self.counts.values())))

    def _is_local(self, topic: Topic) -> bool:
        """Whether readers of this process get the topic without DDS: not when a late one must still get it."""
        return topic.kind is not TopicKind.LATCHED and self._bus.nodes.issuperset(topic.publishers)

    def _remote_readers(self, topic: Topic) -> int:
        """Count the readers that DDS must reach."""
        readers = self.wiring.readers(topic)
        return sum(reader not in self._bus.nodes for reader in readers) if self._is_local(topic) else len(readers)

    def _look_for_bystanders(self) -> None:
        """Publish over DDS, too, what somebody outside the run has subscribed to."""
        for name, (publisher, _) in self._publishers.items():
            if not self._over_dds[name] and publisher.get_subscription_count():
                self._over_dds[name] = True

    def _announce_when_matched(self) -> None:
        if self._prepared() and not self.unmatched():
            self.node.destroy_timer(self._timer)
            self._announced = True
            self._ready.publish(Ready(node=self.name, run=self.wiring.run, since_ns=self.since_ns))

    def _once_announced(self, on_bytes: Callable[[bytes], None]) -> Callable[[bytes], None]:
        """Take no step of a run that began without this node: another one of its name is part of it."""

        def take(data: bytes) -> None:
            if self._announced:
                on_bytes(data)
            else:
                reason = "a run has begun without this node in this ROS domain already: set another ROS_DOMAIN_ID"
                self.lifetime.fail(self.name, reason)

        return take

    def _set_aside(self, topic: str, _data: bytes) -> None:
        """Leave out what another program says on a topic of the run, and name it once."""
        if topic not in self._strange:
            self._strange.add(topic)
            told = f"{topic}: messages of a publisher that is not of this run are left out"
            self.log.warning(told)

    def _on_end(self, _message: RunEnd) -> None:
        self.lifetime.leave(self.name)


class _Sorted:
    """Tells the publisher known since step 0 from others by its sequence numbers, which have no gap.

    rclpy's message info does not say which publisher sent a message, but which of its messages this is. The run's own
    publisher begins at step 0 with number 1; one that comes later is behind it.
    """

    # asks rclpy for the message info, which SingleThreadedExecutor hands over as a second argument, and the
    # EventsExecutor of 7.1.6 as a tuple with the message
    __signature__ = inspect.signature(lambda data, info: None)  # noqa: ARG005 (only the shape counts)

    def __init__(self, on_own: Callable[[bytes], None], on_other: Callable[[bytes], None]) -> None:
        self._on_own, self._on_other = on_own, on_other
        self._next = 1

    def __call__(self, *received: Any) -> None:  # noqa: ANN401 (rclpy's, see above)
        data, info = received if len(received) > 1 else received[0]
        if info["publication_sequence_number"] == self._next:
            self._next += 1
            self._on_own(data)
        else:
            self._on_other(data)


def second_name(topic: Topic) -> str:
    """Return the name under which a bag keeps the messages of a topic's second publisher."""
    return f"{topic.name}/{SECOND_PUBLISHER}"


def data_qos(topic: Topic) -> QoSProfile:
    """Return the QoS profile under which a recorded topic is published and read."""
    latched = topic.qos.durability is Durability.TRANSIENT_LOCAL
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=topic.qos.depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
