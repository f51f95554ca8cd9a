"""Messages whose length varies: records <-> bytes, through rosbags' serialiser."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from bags.mcap.errors import BagError
from bags.mcap.topic import Topic
from bags.wire.records import DesignRecord, DiagnosticLevel, HistoryRecord
from bags.wire.row import Spot
from bags.wire.varying import deserialize, fields_of, header_of, new_message, record_of, serialize
from dgu_sim.grid import Link
from dgu_sim.relay import Action, Origin, RelayEvent
from monitor.link_monitor import MonitorOutput
from monitor.stream_guard import StreamFault


@dataclass(frozen=True, slots=True, kw_only=True)
class AttackEventCodec:
    """`dcmg_msgs/msg/AttackEvent` on /attacks/events."""

    topic: Topic
    period_ns: int

    @classmethod
    def at(cls, spot: Spot) -> "AttackEventCodec":
        """The codec of a row at a place."""
        return cls(topic=spot.topic, period_ns=spot.period_ns)

    def encode(self, event: RelayEvent) -> bytes:
        """Bytes of one event."""
        return serialize(
            self.topic.type_name,
            header=header_of(event.step, self.period_ns, str(event.link)),
            step=event.step,
            attack=event.attack,
            source=event.link.source,
            target=event.link.target,
            action=_ACTIONS[event.action],
            kind=event.kind,
            parameters=event.parameters,
            origin=event.origin.value,
        )

    def decode(self, data: bytes) -> RelayEvent:
        """The event.

        Raises:
            BagError: An action or origin that does not exist.
        """
        message = deserialize(self.topic.type_name, data)
        actions = {number: action for action, number in _ACTIONS.items()}
        if message.action not in actions or message.origin not in set(Origin):
            raise BagError(
                f"{self.topic.name}: action {message.action} by {message.origin!r}, "
                f"expected one of {sorted(actions)} by one of {', '.join(Origin)}"
            )
        return RelayEvent(
            step=message.step,
            attack=message.attack,
            link=Link(message.source, message.target),
            action=actions[message.action],
            kind=message.kind,
            parameters=message.parameters,
            origin=Origin(message.origin),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class DiagnosticsCodec:
    """`diagnostic_msgs/msg/DiagnosticArray` of one monitor: one status for each incoming link, once a second."""

    topic: Topic
    period_ns: int
    monitor: int
    sources: tuple[int, ...]

    @classmethod
    def at(cls, spot: Spot) -> "DiagnosticsCodec":
        """The codec of a row at a place."""
        return cls(topic=spot.topic, period_ns=spot.period_ns, monitor=spot.place.target, sources=spot.sources)

    def due(self, step: int) -> bool:
        """Whether step k is the first one in a new whole second; step 0 is."""
        second = step * self.period_ns // 1_000_000_000
        return step == 0 or second != (step - 1) * self.period_ns // 1_000_000_000

    def encode(
        self, step: int, outputs: Sequence[MonitorOutput], faults: Sequence[Sequence[StreamFault]] | None = None
    ) -> bytes:
        """Bytes of step k.

        Args:
            step: k.
            outputs: What the monitor concludes from each incoming link, in the order of `sources`.
            faults: What is wrong with each link's stream; None: nothing.
        """
        streams = [()] * len(outputs) if faults is None else faults
        status = [
            self._status(source, output, stream)
            for source, output, stream in zip(self.sources, outputs, streams, strict=True)
        ]
        return serialize(
            self.topic.type_name, header=header_of(step, self.period_ns, f"dgu_{self.monitor}"), status=status
        )

    def decode(self, data: bytes) -> Mapping[int, DiagnosticLevel]:
        """Level of each incoming link by the number of the watched DGU."""
        message = deserialize(self.topic.type_name, data)
        return {
            int(status.name.rpartition(" ")[2].partition("-")[0]): DiagnosticLevel(status.level)
            for status in message.status
        }

    def _status(self, source: int, output: MonitorOutput, stream: Sequence[StreamFault]) -> object:
        level, sentence = _judge(output)
        values = {
            "phase": _PHASES[int(output.phase)],
            "residual": _plain(output.residual),
            "threshold": _plain(output.threshold),
        }
        if stream:
            values["stream"] = " ".join(fault.value for fault in stream)
            level, sentence = DiagnosticLevel.ERROR, f"{sentence}; stream: {values['stream']}"
        return new_message(
            "diagnostic_msgs/msg/DiagnosticStatus",
            level=int(level),
            name=f"monitor_{self.monitor}: link {source}-{self.monitor}",
            message=sentence,
            hardware_id=f"dgu_{self.monitor}",
            values=[new_message("diagnostic_msgs/msg/KeyValue", key=key, value=value) for key, value in values.items()],
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class HistoryCodec:
    """`dcmg_msgs/msg/History` of one DGU, or of the grid: one message for each offline experiment."""

    topic: Topic
    dgu: int
    frame: str

    @classmethod
    def at(cls, spot: Spot) -> "HistoryCodec":
        """The codec of a row at a place."""
        return cls(topic=spot.topic, dgu=spot.place.source, frame=spot.frame)

    def encode(self, record: HistoryRecord) -> bytes:
        """Bytes of one experiment."""
        tables = {name: getattr(record, name) for name in _HISTORY_COLUMNS}
        return serialize(
            self.topic.type_name,
            header=header_of(0, 0, self.frame),
            dgu=record.dgu,
            experiment=record.experiment,
            experiments=record.experiments,
            sampling_period_sec=record.sampling_period_sec,
            samples=len(record.y),
            **{columns: tables[name].shape[1] for name, columns in _HISTORY_COLUMNS.items()},
            **{name: np.ascontiguousarray(table, dtype=np.float64).ravel() for name, table in tables.items()},
        )

    def decode(self, data: bytes) -> HistoryRecord:
        """The experiment.

        Raises:
            BagError: The arrays do not have the announced shapes.
        """
        message = deserialize(self.topic.type_name, data)
        shapes = {name: (message.samples, getattr(message, columns)) for name, columns in _HISTORY_COLUMNS.items()}
        for name, shape in shapes.items():
            if getattr(message, name).size != shape[0] * shape[1]:
                raise BagError(
                    f"{self.topic.name}: {name} has {getattr(message, name).size} values, "
                    f"expected {shape[0]} rows of {shape[1]}"
                )
        arrays = {name: np.array(getattr(message, name)).reshape(shape) for name, shape in shapes.items()}
        return HistoryRecord(
            dgu=message.dgu,
            experiment=message.experiment,
            experiments=message.experiments,
            sampling_period_sec=message.sampling_period_sec,
            **arrays,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignCodec:
    """`dcmg_msgs/msg/Design` of one link, of an own state, of an estimator of inputs, or of a team."""

    topic: Topic
    source: int
    monitor: int
    frame: str

    @classmethod
    def at(cls, spot: Spot) -> "DesignCodec":
        """The codec of a row at a place."""
        return cls(topic=spot.topic, source=spot.place.source, monitor=spot.place.target, frame=spot.frame)

    def encode(self, record: DesignRecord) -> bytes:
        """Bytes of one design."""
        return serialize(self.topic.type_name, header=header_of(0, 0, self.frame), **fields_of(record))

    def decode(self, data: bytes) -> DesignRecord:
        """The design."""
        return record_of(DesignRecord, deserialize(self.topic.type_name, data))


# the constants of AttackEvent.msg
_ACTIONS = {Action.START: 1, Action.STOP: 2}
_HISTORY_COLUMNS = {"u": "inputs", "y": "outputs", "x": "states", "d": "applied", "w": "own"}
# the constants of Residual.msg
_PHASES = ("refused", "settling", "calibrating", "armed")
_ARMED = 3


def _judge(output: MonitorOutput) -> tuple[DiagnosticLevel, str]:
    phase = int(output.phase)
    if phase == 0:
        return DiagnosticLevel.STALE, "not monitored: no observer could be designed"
    if phase < _ARMED:
        return DiagnosticLevel.WARN, f"not armed yet: {_PHASES[phase]}"
    return (DiagnosticLevel.ERROR, "alarm") if output.alarm else (DiagnosticLevel.OK, "armed, no alarm")


def _plain(numbers: Iterable[object]) -> str:
    return json.dumps([float(cast("float", number)) for number in numbers])
