"""The topics of a run as its public domain knows them: the recorded ones, and run control."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bags.wire.schema import ATTACKER_NODE, CLOCK_NODE
from dcmg_nodes.ports import CONTROL_OUT_QOS, data_qos
from dcmg_nodes.wiring import DONE, END, PACING, PROGRESS, READY, RECORDER_NODE, SECOND, SECOND_MATCHED

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile

    from dcmg_nodes.wiring import Wiring


@dataclass(frozen=True, slots=True, kw_only=True)
class PublicTopic:
    """One topic.

    Attributes:
        name: ROS topic name.
        type_name: `package/msg/Type`.
        publisher: name of the node that publishes it, of the first where several do.
        readers: how many subscriptions the run itself has.
        qos: of its publishers.
    """

    name: str
    type_name: str
    publisher: str
    readers: int
    qos: QoSProfile


def public_topics(wiring: Wiring) -> list[PublicTopic]:
    """Return every topic of a run."""
    found = [
        PublicTopic(
            name=topic.name,
            type_name=topic.type_name,
            publisher=topic.publishers[0],
            readers=len(wiring.readers(topic)),
            qos=data_qos(topic),
        )
        for topic in wiring.topics.all
    ]
    control = {
        READY: ("Ready", CLOCK_NODE, 1),
        PROGRESS: ("Progress", RECORDER_NODE, 1),
        PACING: ("Pacing", CLOCK_NODE, 1),
        DONE: ("NodeDone", RECORDER_NODE, 1),
        END: ("RunEnd", RECORDER_NODE, len(wiring.nodes) - 1),
        SECOND: ("SecondPublisher", ATTACKER_NODE, 1),
        SECOND_MATCHED: ("SecondPublisher", RECORDER_NODE, 1),
    }
    return found + [
        PublicTopic(
            name=name, type_name=f"dcmg_msgs/msg/{kind}", publisher=publisher, readers=readers, qos=CONTROL_OUT_QOS
        )
        for name, (kind, publisher, readers) in control.items()
    ]
