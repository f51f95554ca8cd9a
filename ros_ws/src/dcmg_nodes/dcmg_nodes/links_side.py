"""A monitor node's part that looks at each incoming link by itself: an observer and a detector on each."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from bags.wire.convert import design_record, history_of
from monitor import detectors, observers
from monitor.link_monitor import LinkMonitor

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from bags.wire.combined_topics import OwnCodec
    from bags.wire.records import HistoryRecord
    from bags.wire.schema import RunTopics
    from dcmg_nodes.ports import Ports
    from monitor.combined import CombinedPlan, Received
    from monitor.link_monitor import MonitorOutput, MonitorState
    from monitor.stream_guard import Faults


class LinksSide:
    """Steps one `LinkMonitor` for each link; `alarm` tells of an alarm on one.

    Attributes:
        own: None: what the own DGU measures does not matter here.
    """

    own: OwnCodec | None = None

    def __init__(
        self,
        ports: Ports,
        topics: RunTopics,
        dgu: int,
        plan: CombinedPlan,
        alarm: Callable[[int, int, MonitorOutput], None],
    ) -> None:
        """Subscribe to the histories of the neighbours."""
        self._ports, self._plan, self._alarm = ports, plan, alarm
        links = [link for link in topics.links if link.target == dgu]
        self._residuals = [topics.residual(link) for link in links]
        self._histories = [topics.history(link.source) for link in links]
        self._designs = [topics.design(link) for link in links]
        self._experiments: list[list[HistoryRecord]] = [[] for _ in links]
        self._monitors: dict[int, LinkMonitor] = {}
        self._states: dict[int, MonitorState] = {}
        for slot, history in enumerate(self._histories):
            ports.subscribe(history.topic, partial(self._receive_history, slot))

    @property
    def ready(self) -> bool:
        """Whether everything is designed."""
        return len(self._monitors) == len(self._residuals)

    def step(
        self, k: int, received: Sequence[Received], own: bytes | None, faults: Sequence[Faults] | None
    ) -> Sequence[MonitorOutput]:
        """Take the samples of step k, tell what follows, and return what the monitors of the links conclude."""
        del own, faults
        return [self._watch(k, slot, sample) for slot, sample in enumerate(received)]

    def _receive_history(self, slot: int, data: bytes) -> None:
        experiments = self._experiments[slot]
        experiments.append(self._histories[slot].decode(data))
        if len(experiments) == experiments[0].experiments:
            self._design(slot)

    def _design(self, slot: int) -> None:
        codec = self._designs[slot]
        kind, options = self._plan.observer
        design = observers.design(kind, history_of(self._experiments[slot]), options)
        if not design.accepted:
            reason = f"link {codec.source}-{codec.monitor} is not monitored: {design.verdict}"
            self._ports.log.warning(reason)
        detector = detectors.build(*self._plan.detector, self._plan.sampling_period_sec)
        self._monitors[slot] = LinkMonitor(
            observer=design.observer, detector=detector, channels=design.channels, blind=design.blind
        )
        self._states[slot] = self._monitors[slot].init()
        record = design_record(design, codec.source, codec.monitor)
        self._ports.publish(codec.topic.name, codec.encode(record))

    def _watch(self, k: int, slot: int, sample: Received) -> MonitorOutput:
        self._states[slot], output = self._monitors[slot].step(self._states[slot], sample.y, sample.delivered)
        codec = self._residuals[slot]
        self._alarm(slot, codec.source, output)
        self._ports.publish(codec.topic.name, codec.encode(k, output))
        return output
