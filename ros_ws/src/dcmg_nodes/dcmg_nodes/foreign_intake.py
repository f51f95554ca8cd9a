"""Topics that are not ours: found, checked against a mapping, subscribed to, and put on the sampling grid."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from bags.foreign.live import Early, live_sampling
from bags.foreign.recordings import stamp_of, uses_header
from bags.mcap.errors import BagError
from dcmg_nodes.errors import NodeError
from dcmg_nodes.foreign_types import definitions_of_class, foreign_class

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from rclpy.node import Node

    from bags.foreign.fields import FieldPath
    from bags.foreign.mapping import Mapping as ForeignMapping
    from bags.foreign.sampling import Row

_LOOK_SEC = 0.1
_DEPTH = 1000


class ForeignIntake:
    """Rows of the fields of some topics, as soon as they are complete.

    Args:
        node: whose subscriptions they are.
        mapping: says which clock counts and how to sample.
        fields: wanted fields of each topic.
        period_ns: T_s [ns].
        on_rows: called with the rows that became complete.
        on_failure: called with one line when this cannot go on.
    """

    def __init__(
        self,
        node: Node,
        mapping: ForeignMapping,
        fields: Mapping[str, tuple[FieldPath, ...]],
        period_ns: int,
        *,
        on_rows: Callable[[Sequence[Row]], None],
        on_failure: Callable[[str], None],
    ) -> None:
        """Begin to look for the topics."""
        self._node, self._mapping, self._fields = node, mapping, fields
        self._period_sec = period_ns * 1e-9
        self._on_rows, self._on_failure = on_rows, on_failure
        self._sampling = live_sampling(mapping, len(fields), period_ns)
        self.state = self._sampling.init()
        self._looking = node.create_timer(_LOOK_SEC, self._look)

    def missing(self) -> list[str]:
        """Return the topics that nobody publishes."""
        return [name for name in self._fields if not self._node.count_publishers(name)]

    def others(self) -> list[str]:
        """Return the topics that somebody publishes, ours left out."""
        own = {name for name, _ in self._node.get_publisher_names_and_types_by_node(self._node.get_name(), "/")}
        names = [name for name, _ in self._node.get_topic_names_and_types()]
        return sorted(name for name in names if name not in own and self._node.count_publishers(name))

    def _look(self) -> None:
        types = {name: found for name, found in self._node.get_topic_names_and_types() if name in self._fields}
        if self.missing() or len(types) < len(self._fields):
            return
        self._node.destroy_timer(self._looking)
        try:
            self._subscribe({name: types[name][0] for name in self._fields})
        except (BagError, NodeError) as error:
            self._on_failure(str(error))

    def _subscribe(self, types: dict[str, str]) -> None:
        classes = {topic: foreign_class(type_name, topic) for topic, type_name in types.items()}
        definitions = {
            name: fields for type_name in types.values() for name, fields in definitions_of_class(type_name).items()
        }
        by_header = uses_header(types, definitions, self._mapping.stamps)
        for topic, paths in self._fields.items():
            for path in paths:
                path.check(types[topic], definitions)
        for track, (topic, paths) in enumerate(self._fields.items()):
            take = partial(self._take, track, paths, by_header)
            self._node.create_subscription(classes[topic], topic, take, self._qos(topic))
        self._waiting = self._node.create_timer(self._period_sec, self._wait)

    def _qos(self, topic: str) -> QoSProfile:
        """As reliable as every publisher of the topic offers."""
        offered = [one.qos_profile.reliability for one in self._node.get_publishers_info_by_topic(topic)]
        reliable = all(one == ReliabilityPolicy.RELIABLE for one in offered)
        return QoSProfile(
            history=HistoryPolicy.KEEP_LAST,
            depth=_DEPTH,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.VOLATILE,
        )

    def _take(self, track: int, paths: Sequence[FieldPath], by_header: bool, message: Any) -> None:  # noqa: ANN401, FBT001 (any message class; bound by partial)
        now = self._now_ns()
        try:
            values = tuple([path.read(message) for path in paths])
        except BagError as error:
            self._on_failure(str(error))
            return
        heard = Early(track, stamp_of(message) if by_header else now, values)
        self.state, rows = self._sampling.hear(self.state, heard, now)
        self._on_rows(rows)

    def _wait(self) -> None:
        self.state, rows = self._sampling.wait(self.state, self._now_ns())
        self._on_rows(rows)

    def _now_ns(self) -> int:
        return int(self._node.get_clock().now().nanoseconds)
