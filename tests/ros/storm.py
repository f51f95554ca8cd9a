"""A program that does not belong to a run: it publishes on every topic of one, in every form, and says how often.

python storm.py SCENARIO LISTENERS     (in the run's ROS domain, where so many others listen to every topic)
"""

from __future__ import annotations

import json
import math
import sys
import time
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import rclpy
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from bags.watch.scenarios import load_scenario
from dcmg_nodes.ports import message_class
from dcmg_nodes.public import public_topics
from dcmg_nodes.wiring import wiring_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rclpy.publisher import Publisher

NAME, OTHER_TYPE = "stray_program", "stray_types"
MATCHED_SEC = 40.0
HUGE = 60_000
STEPS = (0, 1, 2**63)  # of the distant past and future; those about now come from what is heard


def filled(kind: type[Any], number: float, step: int, text: str) -> Any:  # noqa: ANN401 (generated classes)
    """Return a message with one number in every float, a step, and a text in every string."""
    message = kind()
    for name, form in message.get_fields_and_field_types().items():
        old = getattr(message, name)
        if name in {"step", "steps"}:
            setattr(message, name, step)
        elif form in {"double", "float"}:
            setattr(message, name, number)
        elif form.startswith("double["):
            setattr(message, name, [number] * len(old))
        elif form == "sequence<double>":
            setattr(message, name, [number] * 3)
        elif form == "string":
            setattr(message, name, text)
        elif form == "std_msgs/Header":
            old.stamp.sec, old.frame_id = int(time.time()), text
    return message


def forms(kind: type[Any], heard: bytes | None, step: int) -> Iterator[bytes]:
    """Yield the bytes of stale, next, future, NaN, huge and short messages, and of those with a stamp of the wall."""
    for number in (1.0, math.nan, math.inf, 1e308):
        for claimed in (*STEPS, step, step + 1, step + 2, step + 16):
            yield bytes(serialize_message(filled(kind, number, claimed, "dgu_1")))
    yield bytes(serialize_message(filled(kind, 1.0, step, "x" * HUGE)))
    yield bytes(serialize_message(kind()))
    sound = heard or bytes(serialize_message(filled(kind, 1.0, step, "recorder")))
    yield sound
    yield sound[: len(sound) // 2]
    yield sound[:4]
    yield b"\x00\x01\x00\x00\xff\xff\xff\xff" * 3


class Storm:
    """Publishers on every topic, and one listener on each, to know what the run says at the moment."""

    def __init__(self, scenario: Path) -> None:
        """Join the domain of the environment."""
        rclpy.init()
        self._node = Node(NAME)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._heard: dict[str, bytes] = {}
        self._step = 0
        self._publishers: list[tuple[Publisher, type[Any]]] = []
        topics = public_topics(wiring_of(load_scenario(scenario)))
        self._readers = [topic.readers for topic in topics]
        for topic in topics:
            kind = message_class(topic.type_name)
            self._publishers.append((self._node.create_publisher(kind, topic.name, topic.qos), kind))
        tick = message_class("dcmg_msgs/msg/Tick")
        self._tick = self._node.create_subscription(tick, "/tick", self._on_tick, 100)
        self._other = rclpy.Context()
        self._other.init()
        other = Node(OTHER_TYPE, context=self._other)
        self._wrong = [other.create_publisher(String, one.topic_name, 10) for one, _ in self._publishers]

    def wait(self, listeners: int) -> list[str]:
        """Wait until the run and the others read every publisher; return the topics where some do not."""
        deadline = time.monotonic() + MATCHED_SEC
        while (alone := self._alone(listeners)) and time.monotonic() < deadline:
            self._executor.spin_once(timeout_sec=0.05)
        return alone

    def _alone(self, listeners: int) -> list[str]:
        found = zip(self._publishers, self._readers, strict=True)
        return [one.topic_name for (one, _), own in found if one.get_subscription_count() < own + listeners]

    def blow(self) -> Counter[str]:
        """Send every form on every topic; return how many messages those are of each."""
        sent: Counter[str] = Counter()
        for publisher, kind in self._publishers:
            self._executor.spin_once(timeout_sec=0.0)
            for data in forms(kind, self._heard.get(publisher.topic_name), self._step):
                try:
                    publisher.publish(data)
                except rclpy_implementation.RCLError:
                    continue  # longer than its type can be
                sent[publisher.topic_name] += 1
            time.sleep(0.002)  # a burst would only lose its own messages
        for wrong in self._wrong:
            wrong.publish(String(data="not what is spoken here"))
        return sent

    def settle(self) -> None:
        """Wait until whoever listens has it all."""
        for publisher, _ in self._publishers:
            publisher.wait_for_all_acked(Duration(seconds=MATCHED_SEC))
        time.sleep(0.5)  # those of another type have no reader that could tell

    def _on_tick(self, tick: Any) -> None:  # noqa: ANN401 (generated class)
        self._step = tick.step


def main(scenario: Path, listeners: int) -> None:
    """Blow once."""
    storm = Storm(scenario)
    alone = storm.wait(listeners)
    sent = storm.blow()
    storm.settle()
    sys.stdout.write(json.dumps({"unmatched": alone, "sent": sent}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
