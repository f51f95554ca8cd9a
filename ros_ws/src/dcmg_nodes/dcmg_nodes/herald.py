"""Alarms and attacks as log lines on /rosout, under the names of the nodes that tell them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dcmg_msgs.msg import Alarm, AttackEvent

from bags.wire.schema import ATTACKER_NODE, monitor_name
from dcmg_nodes.ports import data_qos

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rclpy.node import Node

    from dcmg_nodes.wiring import Wiring


class Herald:
    """Listens in the run's own domain and logs in the public one.

    Args:
        inner: node in the run's own domain.
        faces: nodes in the public domain, by their names in the run.
        wiring: which topics carry alarms and attacks.
    """

    def __init__(self, inner: Node, faces: Mapping[str, Node], wiring: Wiring) -> None:
        """Subscribe to what is rarely said."""
        self._inner, self._faces = inner, faces
        topics = wiring.topics
        alarms = [topics.alarms(dgu).topic for dgu in topics.monitors]
        events = topics.attack_events().topic
        self._subscriptions = [
            inner.create_subscription(Alarm, topic.name, self._on_alarm, data_qos(topic)) for topic in alarms
        ]
        self._subscriptions.append(
            inner.create_subscription(AttackEvent, events.name, self._on_attack, data_qos(events))
        )

    def close(self) -> None:
        """Log nothing more."""
        for subscription in self._subscriptions:
            self._inner.destroy_subscription(subscription)

    def _on_alarm(self, alarm: Alarm) -> None:
        log = self._faces[monitor_name(alarm.monitor)].get_logger()
        own = alarm.source == alarm.monitor
        where = f"in the own state of DGU {alarm.monitor}" if own else f"on link {alarm.source}-{alarm.monitor}"
        if alarm.active:
            raised = f"alarm {where}, step {alarm.step}"
            log.warning(raised)
        else:
            over = f"alarm {where} is over, step {alarm.step}"
            log.info(over)

    def _on_attack(self, event: AttackEvent) -> None:
        does = "starts" if event.action == AttackEvent.START else "stops"
        line = f"attack {event.attack} ({event.kind}) {does} on link {event.source}-{event.target}, step {event.step}"
        self._faces[ATTACKER_NODE].get_logger().info(line)
