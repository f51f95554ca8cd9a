"""Who speaks on a run's topics without belonging to it: heard in the run's public domain, counted, kept apart."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import TYPE_CHECKING

from rclpy.qos import QoSProfile, ReliabilityPolicy

from dcmg_nodes.options import STRANGERS_SUMMARY
from dcmg_nodes.ports import message_class

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path
    from typing import TextIO

    from rclpy.node import Node

    from dcmg_nodes.public import PublicTopic

EARS_NODE = "dcmg_outside"  # its subscriptions are nobody's wish to listen
MESSAGES = "messages.jsonl"
_LOOK_SEC = 0.25
_NOT_YET_KNOWN = "_NODE_NAME_UNKNOWN_"
_KEPT = 1000  # messages of a topic that are kept word for word
_KEPT_BYTES = 4096  # of each
_EAR_QOS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)  # as the run's own readers are


@dataclass(slots=True, kw_only=True)
class Heard:
    """What came from outside on one topic.

    Attributes:
        publishers: full names of the nodes that publish on it, those of another type with that type.
        messages: how many messages were heard; those of another type never arrive.
    """

    publishers: list[str] = field(default_factory=list)
    messages: int = 0


class Outside:
    """Listens on every topic of a run, in a participant that does not see the run's own mirror.

    Args:
        node: in the public domain; every publisher that it sees belongs to somebody else.
        topics: of the run.
        folder: where to keep what is heard; made when there is something.
    """

    def __init__(self, node: Node, topics: Sequence[PublicTopic], folder: Path) -> None:
        """Subscribe to every topic, as often as the run itself does: whoever waits for its readers finds them."""
        self._node, self._topics, self._folder = node, topics, folder
        self._heard: dict[str, Heard] = {}
        self._changed = False
        self._log: TextIO | None = None
        self.taken = 0  # messages, by all its subscriptions
        self._subscriptions = []
        for topic in topics:
            kind = message_class(topic.type_name)
            for number in range(topic.readers):
                callback = partial(self._hear, topic) if number == 0 else self._ignore
                self._subscriptions.append(node.create_subscription(kind, topic.name, callback, _EAR_QOS, raw=True))
        self._timer = node.create_timer(_LOOK_SEC, self.look)

    def look(self) -> None:
        """Note who is there, and write the summary down if it has changed."""
        for topic in self._topics:
            if self._node.count_publishers(topic.name):
                self._note_publishers(topic)
        if self._changed:
            self._changed = False
            self._folder.mkdir(exist_ok=True)
            text = json.dumps({topic: asdict(heard) for topic, heard in self._heard.items()}, indent=1)
            part = self._folder / f"{STRANGERS_SUMMARY}.part"
            part.write_text(text)
            part.replace(self._folder / STRANGERS_SUMMARY)

    def _hear(self, topic: PublicTopic, data: bytes) -> None:
        self.taken += 1
        heard = self._heard.get(topic.name)
        if heard is None or not heard.publishers:
            heard = self._note_publishers(topic)
        heard.messages += 1
        self._changed = True
        if heard.messages <= _KEPT:
            if self._log is None:
                self._folder.mkdir(exist_ok=True)
                self._log = (self._folder / MESSAGES).open("a", buffering=1)
            line = {"received_sec": time.time(), "topic": topic.name, "type": topic.type_name, "bytes": len(data)}
            self._log.write(json.dumps({**line, "cdr": data[:_KEPT_BYTES].hex()}) + "\n")

    def _ignore(self, _data: bytes) -> None:
        """Not the first reader of its topic: the first has heard it."""
        self.taken += 1

    def _note_publishers(self, topic: PublicTopic) -> Heard:
        heard = self._heard.setdefault(topic.name, Heard())
        for endpoint in self._node.get_publishers_info_by_topic(topic.name):
            if endpoint.node_name == _NOT_YET_KNOWN:
                continue  # its name comes a little later; `look` finds it then
            name = f"{endpoint.node_namespace.rstrip('/')}/{endpoint.node_name}"
            if endpoint.topic_type != topic.type_name:
                name += f" ({endpoint.topic_type})"
            if name not in heard.publishers:
                heard.publishers.append(name)
                self._changed = True
        return heard
