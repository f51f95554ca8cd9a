"""One recorded topic of a run."""

from dataclasses import dataclass
from enum import Enum

from bags.mcap.cdr import Layout
from bags.mcap.qos import EVENT_QOS, LATCHED_QOS, STREAM_QOS, Qos
from bags.mcap.typestore import Definitions

NANOSECONDS_PER_SECOND = 1_000_000_000


class TopicKind(Enum):
    """How often a topic speaks."""

    PER_STEP = "per step"  # exactly one message at every step
    EVENT = "event"  # when something happens, behind the per-step messages of its step; kept for late subscribers
    LATCHED = "latched"  # before step 0, kept for late subscribers


@dataclass(frozen=True, slots=True, kw_only=True)
class Topic:
    """Name, type and origin of one recorded topic.

    Attributes:
        name: ROS topic name.
        type_name: Full message type name, `package/msg/Type`.
        publishers: Names of the nodes that publish it: one, except for /diagnostics.
        kind: Per step, event or latched.
        layout: Byte layout, None when messages vary in length.
        definitions: Of types that are not as ours: those of an older bag.
    """

    name: str
    type_name: str
    publishers: tuple[str, ...]
    kind: TopicKind
    layout: Layout | None = None
    definitions: Definitions = ()

    @property
    def qos(self) -> Qos:
        """Quality of service of its publishers and, in our own nodes, of its subscribers."""
        return {TopicKind.LATCHED: LATCHED_QOS, TopicKind.EVENT: EVENT_QOS}.get(self.kind, STREAM_QOS)
