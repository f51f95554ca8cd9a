"""The monitors of all DGUs with everything they combine, as the offline simulation and the replay need them.

Each steps through the same `DguMonitor.step` as in its node, fed with the same numbers: the same bits. One run is
stepped in floats, several side by side in arrays.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from bags.watch.combined_arrays import CombinedFields, fields_of
from bags.watch.monitors import MonitorArrays
from bags.wire.convert import design_record
from bags.wire.documents import DesignCodec
from bags.wire.records import DesignRecord
from bags.wire.schema import RunTopics
from dgu_sim.settings import MonitorSettings
from monitor.combined import CombinedDesign, CombinedPlan, DguOutput, DguState, LocalPlan, Own, Received, design
from monitor.history import History
from monitor.linear import Component

if TYPE_CHECKING:
    from monitor.linear import Flag

_WIDTH = 3


class Conclusions(NamedTuple):
    """What all monitors concluded over some steps of one run.

    Attributes:
        links: What the monitors of the links concluded.
        combined: Everything else, as message fields.
    """

    links: MonitorArrays
    combined: CombinedFields


def plan_of(settings: MonitorSettings, sampling_period_sec: float) -> CombinedPlan:
    """What a scenario tells the monitor of every DGU."""
    own, plausible = settings.local, settings.plausibility
    return CombinedPlan(
        observer=(settings.observer.kind, settings.observer.options),
        detector=(settings.detector.kind, settings.detector.options),
        sampling_period_sec=sampling_period_sec,
        local=None
        if own is None
        else LocalPlan(
            decay=own.decay,
            load_sec=own.load_sec,
            load_range_a=own.load_range_a,
            detector=(own.detector.kind, own.detector.options),
        ),
        estimator=None if plausible is None else (plausible.estimator.kind, plausible.estimator.options),
        limits={} if plausible is None else plausible.limits.model_dump(),
        quiet_sec=None if settings.response is None else settings.response.quiet_sec,
    )


def design_combined(
    topics: RunTopics, settings: MonitorSettings, histories: Mapping[int, History]
) -> tuple[CombinedDesign, ...]:
    """Design everything for each monitor of a run, in their order.

    Raises:
        monitor.errors.MonitorError: Unknown kind or option.
    """
    plan = plan_of(settings, topics.sampling_period_ns * 1e-9)
    return tuple(
        design(plan, [histories[source] for source in topics.sources(monitor)], histories.get(monitor))
        for monitor in topics.monitors
    )


def design_messages(
    topics: RunTopics, designs: Sequence[CombinedDesign]
) -> tuple[tuple[DesignCodec, DesignRecord], ...]:
    """What the monitors say about their designs before step 0, in canonical order."""
    each = [messages_of(topics, monitor, designed) for monitor, designed in zip(topics.monitors, designs, strict=True)]
    return tuple(message for kind in zip(*each, strict=True) for messages in kind for message in messages)


def messages_of(
    topics: RunTopics, monitor: int, designed: CombinedDesign
) -> tuple[list[tuple[DesignCodec, DesignRecord]], ...]:
    """What one monitor says about its designs: of its links, of its own state, of its input estimators."""
    combined = topics.combined
    assert combined is not None  # noqa: S101 - whoever designs these has seen to it
    links = [link for link in topics.links if link.target == monitor]
    own = []
    if designed.local is not None:
        certificate = designed.local.certificate
        record = DesignRecord(
            source=monitor,
            monitor=monitor,
            observer=certificate.kind,
            accepted=certificate.accepted,
            verdict=certificate.verdict,
            certificate=certificate.to_json(),
        )
        own = [(combined.design(monitor), record)]
    estimators = [
        DesignRecord(
            source=link.source,
            monitor=monitor,
            observer=one.kind,
            accepted=one.accepted,
            verdict=one.verdict,
            certificate=one.to_json(),
        )
        for link, one in zip(links, designed.inputs, strict=False)
    ]
    return (
        [
            (topics.design(link), design_record(one, link.source, monitor))
            for link, one in zip(links, designed.links, strict=True)
        ],
        own,
        [(combined.input_design(link), record) for link, record in zip(links, estimators, strict=False)],
    )


@final
@dataclass(slots=True, kw_only=True)
class Watch:
    """All monitors of a run while it goes on: a `dgu_sim.simulate.Respond` that remembers what they said.

    Attributes:
        topics: The links and DGUs.
        designs: What runs at each monitor.
        runs: Runs side by side.
    """

    topics: RunTopics
    designs: Sequence[CombinedDesign]
    runs: int = 1
    _states: list[DguState] = field(init=False)
    _incoming: list[list[int]] = field(init=False)
    _own: list[int] = field(init=False)
    _rows: list[list[DguOutput]] = field(init=False)

    def __post_init__(self) -> None:
        """Start all monitors."""
        self._states = [one.monitor.init() for one in self.designs]
        links, monitors = self.topics.links, self.topics.monitors
        self._incoming = [[at for at, link in enumerate(links) if link.target == one] for one in monitors]
        self._own = [self.topics.dgus.index(one) for one in monitors]
        self._rows = []

    def __call__(
        self,
        sent: NDArray[np.float64],
        reference: NDArray[np.float64],
        received: NDArray[np.float64],
        delivered: NDArray[np.bool_],
        spoofed: Sequence[int] = (),
    ) -> NDArray[np.bool_]:
        """Step all monitors; see `dgu_sim.simulate.Respond`."""
        alone = self.runs == 1
        y, own_y = _vectors(received, alone=alone), _vectors(sent, alone=alone)
        references: Sequence[Component] = reference[0].tolist() if alone else list(reference.T)
        arrived: Sequence[Flag] = delivered[0].tolist() if alone else list(delivered.T)
        dropped = np.zeros(delivered.shape, dtype=np.bool_)
        outputs = []
        for number, (designed, incoming, own) in enumerate(zip(self.designs, self._incoming, self._own, strict=True)):
            self._states[number], output = designed.monitor.step(
                self._states[number],
                [Received(y[at], arrived[at]) for at in incoming],
                Own(own_y[own], references[own]),
                [at in spoofed for at in incoming],
            )
            for at, flag in zip(incoming, output.verdict.dropped, strict=True):
                dropped[:, at] = flag
            outputs.append(output)
        if alone:
            self._rows.append(outputs)
        return dropped

    def follow(
        self,
        sent: NDArray[np.float64],
        reference: NDArray[np.float64],
        received: NDArray[np.float64],
        delivered: NDArray[np.bool_],
        spoofed: Mapping[int, Sequence[int]],
    ) -> None:
        """Take consecutive steps of one run that is over.

        Args:
            sent: y, shape (steps, DGUs, 3).
            reference: V_ref + alpha, shape (steps, DGUs) [V].
            received: y^c, shape (steps, links, 3).
            delivered: Shape (steps, links).
            spoofed: By row, positions of the links whose stream was not one publisher's in order.
        """
        for row in range(len(delivered)):
            y, y_c = sent[row].T[:, None], received[row].T[:, None]
            self(y, reference[row][None], y_c, delivered[row][None], spoofed.get(row, ()))

    def take(self) -> Conclusions:
        """What was said since the last call, of one run."""
        rows, self._rows = self._rows, []
        combined = self.topics.combined
        assert combined is not None  # noqa: S101 - whoever makes a Watch has seen to it
        lags = [one.lag for designed in self.designs for one in designed.monitor.inputs]
        return Conclusions(links=_links(rows, len(self.topics.links)), combined=fields_of(rows, lags, combined))


def _vectors(components: NDArray[np.float64], *, alone: bool) -> list[list[Component]]:
    """Vectors of (3, runs, places) for each place: floats of a single run, arrays over runs of many."""
    if alone:
        vectors: list[list[Component]] = components[:, 0].T.tolist()
        return vectors
    return [list(vector) for vector in components.transpose(2, 0, 1)]


def _links(rows: Sequence[Sequence[DguOutput]], links: int) -> MonitorArrays:
    """What the monitors of the links concluded."""
    steps = len(rows)
    arrays = MonitorArrays(
        phase=np.zeros((steps, links), dtype=np.uint8),
        alarm=np.zeros((steps, links), dtype=np.bool_),
        **{name: np.full((steps, links, _WIDTH), np.nan) for name in ("estimate", "residual", "threshold")},
    )
    for name in ("phase", "alarm", "estimate", "residual", "threshold") if steps and links else ():
        getattr(arrays, name)[:] = [[getattr(said, name) for one in row for said in one.links] for row in rows]
    return arrays
