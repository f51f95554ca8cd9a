"""A monitor node's part that watches: everything that `monitor` runs for one DGU, designed from recorded data alone."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from bags.watch.designs import design_run
from bags.wire.convert import history_of
from bags.wire.row import Need
from bags.wire.stream import lies

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from bags.watch.designs import Told
    from bags.wire.codecs import StepCodec
    from bags.wire.records import HistoryRecord
    from bags.wire.schema import RunTopics
    from dcmg_nodes.ports import Ports
    from monitor.combined import DguMonitor, DguOutput, DguState, Received
    from monitor.link_monitor import MonitorOutput
    from monitor.stream_guard import Faults


class WatchSide:
    """Steps one `DguMonitor`; `alarm` tells of an alarm on a link, or of the own state.

    Attributes:
        own: codec of the own samples, None without a module of the own state.
    """

    def __init__(
        self,
        ports: Ports,
        topics: RunTopics,
        dgu: int,
        told: Told,
        alarm: Callable[[int, int, MonitorOutput], None],
    ) -> None:
        """Subscribe to the histories of the neighbours, and to the own one where the own state is watched."""
        self._ports, self._topics, self._dgu, self._alarm = ports, topics, dgu, alarm
        self._told = told
        links = [link for link in topics.links if link.target == dgu]
        combined = topics.combined
        self.own: StepCodec | None = combined.own(dgu) if combined is not None and topics.has(Need.LOCAL) else None
        self._residuals = [topics.residual(link) for link in links]
        self._inputs = [] if combined is None else [combined.input(link) for link in links]
        self._own_residual = None if combined is None else combined.residual(dgu)
        self._verdict = None if combined is None else combined.verdict(dgu)
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
        told, monitors = self._told, (self._dgu,)
        designs = design_run(self._topics, told.settings, histories, carried=told.carried, monitors=monitors)
        for name, verdict in designs.refusals:
            self._ports.log.warning(f"{name}: {verdict}")  # noqa: G004 - rclpy's logger takes a string
        for codec, record in designs.messages():
            self._ports.publish(codec.topic.name, codec.encode(record))
        (self._monitor,) = designs.monitors
        self._state = self._monitor.init()

    def _tell(self, k: int, output: DguOutput, lags: Sequence[int]) -> None:
        for slot, (codec, said) in enumerate(zip(self._residuals, output.links, strict=True)):
            self._alarm(slot, codec.source, said)
            self._ports.publish(codec.topic.name, codec.encode(k, said))
        if output.local is not None and self._own_residual is not None:
            self._alarm(len(self._residuals), self._dgu, output.local.monitor)
            self._ports.publish(self._own_residual.topic.name, self._own_residual.encode(k, output.local.monitor))
        for estimate, lag, judged in zip(self._inputs, lags, output.inputs, strict=False):
            self._ports.publish(estimate.topic.name, estimate.encode(k, lag, judged))
        if self._verdict is not None:
            self._ports.publish(self._verdict.topic.name, self._verdict.encode(k, output.verdict))
