"""A monitor node's part that draws one conclusion from several tests, designed from recorded data alone."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from bags.watch.combined import messages_of
from bags.wire.convert import history_of
from bags.wire.stream import lies
from monitor.combined import design

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from bags.wire.combined_topics import OwnCodec
    from bags.wire.records import HistoryRecord
    from bags.wire.schema import RunTopics
    from dcmg_nodes.ports import Ports
    from monitor.combined import CombinedPlan, DguMonitor, DguOutput, DguState, Received
    from monitor.link_monitor import MonitorOutput
    from monitor.stream_guard import Faults


class CombinedSide:
    """Steps everything that one DGU's monitor runs; `alarm` tells of an alarm on a link, or of the own state.

    Attributes:
        own: codec of the own samples, None without a module of the own state.
        ready: whether everything is designed.
    """

    def __init__(
        self,
        ports: Ports,
        topics: RunTopics,
        dgu: int,
        plan: CombinedPlan,
        alarm: Callable[[int, int, MonitorOutput], None],
    ) -> None:
        """Subscribe to the histories of the neighbours, and to the own one."""
        self._ports, self._topics, self._dgu, self._plan, self._alarm = ports, topics, dgu, plan, alarm
        combined = topics.combined
        assert combined is not None  # noqa: S101 - the node has seen to it
        links = [link for link in topics.links if link.target == dgu]
        self.own: OwnCodec | None = combined.own(dgu) if combined.parts.local else None
        self._residuals = [topics.residual(link) for link in links]
        self._own_residual, self._verdict = combined.residual(dgu), combined.verdict(dgu)
        self._inputs = [combined.input(link) for link in links]
        self._histories: dict[int, list[HistoryRecord]] = {link.source: [] for link in links}
        if self.own is not None:
            self._histories[dgu] = []
        self._monitor: DguMonitor | None = None
        self._state: DguState | None = None
        for source in self._histories:
            ports.subscribe(topics.history(source).topic, partial(self._receive_history, source))

    @property
    def ready(self) -> bool:
        """Whether everything is designed."""
        return self._monitor is not None

    def step(
        self, k: int, received: Sequence[Received], own: bytes | None, faults: Sequence[Faults] | None
    ) -> Sequence[MonitorOutput]:
        """Take the samples of step k, tell what follows, and return what the monitors of the links conclude."""
        assert self._monitor is not None  # noqa: S101 - no step comes before the node has said that it is ready
        assert self._state is not None  # noqa: S101 - idem
        told = self.own.decode(own)[1] if self.own is not None and own is not None else None
        stream = [lies(one) for one in faults] if faults is not None else ()
        self._state, output = self._monitor.step(self._state, received, told, stream)
        self._tell(k, output, [one.lag for one in self._monitor.inputs])
        return output.links

    def _receive_history(self, source: int, data: bytes) -> None:
        self._histories[source].append(self._topics.history(source).decode(data))
        if all(records and len(records) == records[0].experiments for records in self._histories.values()):
            self._design()

    def _design(self) -> None:
        histories = {source: history_of(records) for source, records in self._histories.items()}
        neighbours = [histories[source] for source in self._topics.sources(self._dgu)]
        designed = design(self._plan, neighbours, histories.get(self._dgu))
        for messages in messages_of(self._topics, self._dgu, designed):
            for codec, record in messages:
                if not record.accepted:
                    reason = f"{codec.topic.name}: {record.verdict}"
                    self._ports.log.warning(reason)
                self._ports.publish(codec.topic.name, codec.encode(record))
        self._monitor, self._state = designed.monitor, designed.monitor.init()

    def _tell(self, k: int, output: DguOutput, lags: Sequence[int]) -> None:
        for slot, (codec, said) in enumerate(zip(self._residuals, output.links, strict=True)):
            self._alarm(slot, codec.source, said)
            self._ports.publish(codec.topic.name, codec.encode(k, said))
        if output.local is not None:
            self._alarm(len(self._residuals), self._dgu, output.local.monitor)
            self._ports.publish(self._own_residual.topic.name, self._own_residual.encode(k, output.local.monitor))
        for estimate, lag, judged in zip(self._inputs, lags, output.inputs, strict=False):
            self._ports.publish(estimate.topic.name, estimate.encode(k, lag, judged))
        self._ports.publish(self._verdict.topic.name, self._verdict.encode(k, output.verdict))
