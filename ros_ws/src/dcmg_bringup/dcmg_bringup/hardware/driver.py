"""Stands in for the laboratory's driver: publishes a bag of anybody's messages at the pace at which it was recorded.

    python -m dcmg_bringup.hardware.driver out/example/field [--rate 1.0] [--wait-for 1]

It knows nothing of us: rosbags reads the bag, rclpy publishes the bytes.
"""

from __future__ import annotations

import argparse
import time
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import rclpy
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosbags.highlevel import AnyReader

from dcmg_nodes.ros_arguments import ros_arguments

if TYPE_CHECKING:
    from collections.abc import Sequence

_DEPTH = 100
_LINGER_SEC = 1.0
_MATCH_SEC = 60.0
_POLL_SEC = 0.02


def publish(bag: Path, rate: float, readers: int) -> int:
    """Publish every message of a bag.

    Args:
        bag: path of the bag.
        rate: how many times as fast as it was recorded.
        readers: how many subscribers of each topic are waited for.

    Returns:
        How many messages were published.
    """
    rclpy.init(args=ros_arguments())
    node = rclpy.create_node("laboratory_driver")
    count = 0
    with AnyReader([bag]) as reader:
        qos = QoSProfile(depth=_DEPTH, reliability=ReliabilityPolicy.RELIABLE)
        publishers = {
            one.topic: node.create_publisher(_message_class(one.msgtype), one.topic, qos) for one in reader.connections
        }
        deadline = time.monotonic() + _MATCH_SEC
        while any(one.get_subscription_count() < readers for one in publishers.values()):
            if time.monotonic() > deadline:
                raise SystemExit(f"nobody subscribed within {_MATCH_SEC:g} s")
            time.sleep(_POLL_SEC)
        began, first_ns = time.monotonic(), reader.start_time
        for connection, stamp_ns, data in reader.messages():
            time.sleep(max(0.0, began + (stamp_ns - first_ns) * 1e-9 / rate - time.monotonic()))
            publishers[connection.topic].publish(bytes(data))
            count += 1
    time.sleep(_LINGER_SEC)  # reliable delivery needs the publishers for a moment longer
    node.destroy_node()
    rclpy.try_shutdown()
    return count


def main(arguments: Sequence[str] | None = None) -> None:
    """Publish the bag named on the command line."""
    parser = argparse.ArgumentParser(description="publish a bag of anybody's messages")
    parser.add_argument("bag", type=Path)
    parser.add_argument("--rate", type=float, default=1.0, help="how many times as fast as it was recorded")
    parser.add_argument("--wait-for", type=int, default=1, help="subscribers of each topic to wait for")
    given = parser.parse_args(arguments)
    print(f"{publish(given.bag, given.rate, given.wait_for)} messages published")  # noqa: T201 (a program's output)


def _message_class(type_name: str) -> Any:  # noqa: ANN401 (generated message classes share no base)
    package, kind, name = type_name.split("/")
    return getattr(import_module(f"{package}.{kind}"), name)


if __name__ == "__main__":
    main()
