"""A program that listens to every topic of a run and never keeps up: it keeps everything, and sleeps.

python tests/ros/bystander.py SCENARIO
"""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import rclpy
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

from bags.watch.scenarios import load_scenario
from dcmg_nodes.ports import message_class
from dcmg_nodes.public import public_topics
from dcmg_nodes.wiring import wiring_of

if __name__ == "__main__":
    rclpy.init()
    node = Node("bystander")
    keep_all = QoSProfile(depth=1, history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
    subscriptions = [
        node.create_subscription(message_class(topic.type_name), topic.name, lambda _: None, keep_all, raw=True)
        for topic in public_topics(wiring_of(load_scenario(Path(sys.argv[1]))))
    ]
    sys.stdout.write("listening\n")
    sys.stdout.flush()
    signal.pause()
