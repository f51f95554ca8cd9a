"""The ROS side of a replay: recorded bytes onto the wire, /clock, and the service that pauses and steps."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ament_index_python.packages import get_package_share_directory
from dcmg_msgs.srv import ControlReplay
from rclpy.duration import Duration
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from bags.mcap.qos import LATCHED_QOS, STREAM_QOS
from bags.runs.playback import CLOCK_TOPIC
from dcmg_nodes.foreign_types import differing_type
from dcmg_nodes.ports import message_class
from dcmg_nodes.services import offer

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    from rclpy.publisher import Publisher

    from bags.runs.playback import Moment, Playback
    from bags.runs.played import PlayedTopic

PLAYER_NODE = "player"
CONTROL_SERVICE = "/player/control"
_NANOSECONDS = 1_000_000_000


class PlayerNode:
    """Publishes what it is given; when, is not its business.

    Args:
        playback: the topics.
        held: topics (by their names in the bag) that are not published.
        queue: messages of a topic that may be unacknowledged; 0: any number.
        on_control: answers the control service.
    """

    def __init__(
        self,
        playback: Playback,
        held: Collection[str],
        queue: int,
        on_control: Callable[[ControlReplay.Request, ControlReplay.Response], ControlReplay.Response],
    ) -> None:
        """Create a publisher for every topic whose type is installed."""
        self.node = Node(PLAYER_NODE, enable_rosout=False, start_parameter_services=False)
        self.counts: dict[str, int] = {}
        self.left_out = dict(playback.left_out)
        self._queue = queue
        self._publishers: dict[str, Publisher] = {}
        self._in_flight: dict[str, int] = {}
        for topic in playback.topics.values():
            if topic.name not in held:
                self._create(topic, playback.names[topic.name])
        clock_is_recorded = any(playback.names[name] == CLOCK_TOPIC for name in self._publishers)
        self._clock = None if clock_is_recorded else self.node.create_publisher(Clock, CLOCK_TOPIC, _qos(latched=False))
        self._service = offer(self.node, ControlReplay, CONTROL_SERVICE, on_control)

    def publish(self, moment: Moment) -> list[float]:
        """Put the messages of a moment on the wire, in their order; return when each went out [s]."""
        times = []
        if self._clock is not None:
            now = Clock()
            now.clock.sec, now.clock.nanosec = divmod(moment.time_ns, _NANOSECONDS)
            self._clock.publish(now)
        for name, data in moment.messages:
            publisher = self._publishers.get(name)
            if publisher is not None:
                publisher.publish(data)
                times.append(time.perf_counter())
                self.counts[name] += 1
                self._in_flight[name] += 1
        return times

    def room_for(self, moment: Moment, timeout_sec: float) -> bool:
        """Wait until no subscriber has more than a queue of messages to acknowledge; tell whether that is so."""
        if not self._queue:
            return True
        for name in {name for name, _ in moment.messages}:
            if self._in_flight.get(name, 0) >= self._queue and not self.acknowledged(name, timeout_sec):
                return False
        return True

    def acknowledged(self, name: str, timeout_sec: float) -> bool:
        """Wait until every subscriber of a topic has what was published on it."""
        publisher = self._publishers[name]
        if publisher.get_subscription_count() and not publisher.wait_for_all_acked(Duration(seconds=timeout_sec)):
            return False
        self._in_flight[name] = 0
        return True

    def listeners(self, name: str) -> int:
        """Count the subscribers of a topic, given by its name in the bag."""
        return self._publishers[name].get_subscription_count() if name in self._publishers else 0

    def _create(self, topic: PlayedTopic, name: str) -> None:
        found = _installed(topic)
        if isinstance(found, str):
            self.left_out[topic.name] = found
            return
        try:
            publisher = self.node.create_publisher(found, name, _qos(latched=topic.latched))
        except InvalidTopicNameException as error:
            reason = f"{error}".partition("\n")[0].rstrip(":")
            self.left_out[topic.name] = f"cannot be published as {name!r} ({reason}): --remap {topic.name}:=NEW"
            return
        self._publishers[topic.name] = publisher
        self.counts[topic.name] = self._in_flight[topic.name] = 0


def _qos(*, latched: bool) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=LATCHED_QOS.depth if latched else STREAM_QOS.depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def _installed(topic: PlayedTopic) -> Any:  # noqa: ANN401 (generated message classes share no base)
    """Return the class of a topic's type, or why its messages cannot be published here."""
    try:
        found = message_class(topic.type_name)
    except (ImportError, AttributeError, ValueError):
        return f"its type {topic.type_name} is not installed here"
    other = next((one for layout in topic.layouts if (one := differing_type(topic.type_name, layout))), None)
    if other is not None:
        return f"its type {other} was laid out in another way when it was recorded than the one installed here"
    installed = _installed_hash(topic.type_name)
    if topic.type_hash and installed and installed != topic.type_hash:
        return f"its type {topic.type_name} was another one when it was recorded than the one installed here"
    return found


def _installed_hash(type_name: str) -> str:
    """RIHS01 hash of an installed type, "" when its package does not tell."""
    package, _, rest = type_name.partition("/")
    try:
        document = json.loads((Path(get_package_share_directory(package)) / f"{rest}.json").read_text("utf-8"))
        hashes = {one["type_name"]: one["hash_string"] for one in document["type_hashes"]}
    except (LookupError, OSError, ValueError):
        return ""
    return str(hashes.get(type_name, ""))
