"""Quality of service of a topic, in the form rosbag2 writes it down."""

from dataclasses import dataclass
from enum import Enum

# what rmw reports for "no deadline, no lifespan, no lease": rmw_time_t of INT64_MAX nanoseconds
_INFINITE = {"sec": 9223372036, "nsec": 854775807}


class Durability(Enum):
    """Whether a late subscriber still gets what was published before."""

    VOLATILE = "volatile"
    TRANSIENT_LOCAL = "transient_local"


@dataclass(frozen=True, slots=True, kw_only=True)
class Qos:
    """Reliable, keep_last.

    Attributes:
        depth: How many messages are kept: more than can ever be in flight.
        durability: Volatile or transient_local.
    """

    depth: int
    durability: Durability

    def to_metadata(self) -> dict[str, object]:
        """One entry of `offered_qos_profiles` in rosbag2's metadata version 9."""
        return {
            "history": "keep_last",
            "depth": self.depth,
            "reliability": "reliable",
            "durability": self.durability.value,
            "deadline": dict(_INFINITE),
            "lifespan": dict(_INFINITE),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(_INFINITE),
            "avoid_ros_namespace_conventions": False,
        }


STREAM_QOS = Qos(depth=1000, durability=Durability.VOLATILE)
EVENT_QOS = Qos(depth=1000, durability=Durability.TRANSIENT_LOCAL)
LATCHED_QOS = Qos(depth=64, durability=Durability.TRANSIENT_LOCAL)
