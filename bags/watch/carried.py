"""The designs in a bag, to be run as they are: the same bits wherever they run."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from bags.mcap.container import open_container, readable
from bags.mcap.errors import BagError
from bags.mcap.topic import Topic, TopicKind
from bags.wire.documents import DesignCodec
from bags.wire.origin import MONITOR_ATTACHMENT, SCENARIO_ATTACHMENT
from bags.wire.records import DesignRecord
from bags.wire.settings import parse_monitor, settings_of
from dgu_sim.scenario import parse_scenario
from monitor.carrying import RUNNING, parsed
from monitor.settings import MonitorSettings

Part = TypeVar("Part")
_DESIGN = "dcmg_msgs/msg/Design"
_SYMBOLS = frozenset((*"ABCDEFGHJLMZ", "conductances", "load", "chi", "start", "correction", "begin"))
_TINY = 1e-300  # keeps 0 / 0 out of a relative difference


@dataclass(frozen=True, slots=True, kw_only=True)
class Carried:
    """Designs, and the settings that they were made with.

    Attributes:
        settings: The monitor section of their run.
        records: The designs by the topic that they were told on.
    """

    settings: MonitorSettings
    records: Mapping[str, DesignRecord]

    def take(
        self,
        codec: DesignCodec,
        settings: MonitorSettings,
        asked: Callable[[MonitorSettings], object],
        restore: Callable[[DesignRecord], Part | None],
    ) -> Part | None:
        """A part as it was designed; None where it was designed otherwise, or the record does not hold everything.

        Args:
            codec: Of the part's design.
            settings: What the monitors are to run.
            asked: What of the settings its design depends on.
            restore: Makes the part of its record.
        """
        record = self.records.get(codec.topic.name)
        if record is None or asked(self.settings) != asked(settings):
            return None
        return restore(record)

    def anew(self, told: Mapping[str, DesignRecord]) -> tuple[str, ...]:
        """Topics of designs that are not the carried ones."""
        return tuple(name for name, record in told.items() if self.records.get(name) != record)

    def compared(self, told: Mapping[str, DesignRecord]) -> dict[str, float]:
        """How far designs, by topic, are from the carried ones: see `difference`; those that have none are left out."""
        return {name: difference(self.records[name], one) for name, one in told.items() if name in self.records}


def read_carried(path: Path | str) -> Carried:
    """The designs in the bag of a run, or of a watched stream.

    Raises:
        BagError: The bag cannot be read, or holds no designs, or not the settings that they were made with.
        dgu_sim.errors.ScenarioError: Its scenario cannot be used.
    """
    path = Path(path)
    container = open_container(path)
    names = {name for name, type_name in container.topics.items() if type_name == _DESIGN}
    records: dict[str, DesignRecord] = {}
    for channels, chunk in container.chunks(names):
        with readable(path):
            for channel_id in chunk.offsets:
                name = channels[channel_id].topic
                if name in names:
                    topic = Topic(name=name, type_name=_DESIGN, publishers=(), kind=TopicKind.LATCHED)
                    codec = DesignCodec(topic=topic, source=0, monitor=0, frame="")
                    records[name] = [codec.decode(payload) for payload in chunk.payloads(channel_id)][-1]
    if not records:
        raise BagError(f"{path}: holds no designs (topics of type {_DESIGN}), expected the bag of a run")
    return Carried(settings=_settings(path, container.attachments), records=records)


def _settings(path: Path, attachments: Mapping[str, bytes]) -> MonitorSettings:
    if SCENARIO_ATTACHMENT in attachments:
        text, source = attachments[SCENARIO_ATTACHMENT].decode(), f"{path}/{SCENARIO_ATTACHMENT}"
        return settings_of(parse_scenario(text, source=source), source)
    if MONITOR_ATTACHMENT in attachments:
        return parse_monitor(attachments[MONITOR_ATTACHMENT].decode(), f"{path}/{MONITOR_ATTACHMENT}")
    raise BagError(f"{path}: holds no {SCENARIO_ATTACHMENT}, expected the settings that its designs were made with")


def difference(one: DesignRecord, other: DesignRecord) -> float:
    """Largest relative difference of a matrix of two designs; infinite where they are not of one kind and shape."""
    if one.certificate == other.certificate:
        return 0.0
    first, second = _matrices(parsed(one.certificate)), _matrices(parsed(other.certificate))
    if (one.observer, one.accepted) != (other.observer, other.accepted) or first.keys() != second.keys():
        return inf
    if any(first[name].shape != second[name].shape for name in first):
        return inf
    apart = (
        float(np.abs(matrix - second[name]).max(initial=0.0)) / float(np.abs(matrix).max(initial=_TINY))
        for name, matrix in first.items()
    )
    return max(apart, default=0.0)


def _matrices(document: Mapping[str, object]) -> dict[str, NDArray[np.float64]]:
    """The matrices of what runs, by their symbols."""
    running = document.get(RUNNING, document)
    found = running.get("matrices", running) if isinstance(running, dict) else {}
    lists = {name: rows for name, rows in found.items() if name in _SYMBOLS} if isinstance(found, dict) else {}
    return {name: np.asarray(rows, dtype=np.float64) for name, rows in lists.items()}
