"""Records of the simulator and the monitors ↔ records of the varying messages."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

from bags.wire.records import DesignRecord, HistoryRecord
from monitor.history import Experiment, History

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dgu_sim.experiment import ExperimentData


def history_records(dgu: int, experiments: Sequence[ExperimentData]) -> list[HistoryRecord]:
    """Put the offline experiments of one DGU into the form in which they travel."""
    return [
        HistoryRecord(
            dgu=dgu,
            experiment=number,
            experiments=len(experiments),
            sampling_period_sec=experiment.sampling_period_sec,
            u=experiment.u,
            y=experiment.y,
            x=experiment.x,
            d=experiment.d,
            w=experiment.w,
        )
        for number, experiment in enumerate(experiments)
    ]


def history_of(records: Sequence[HistoryRecord]) -> History:
    """Put the experiments that arrived for one DGU together.

    Raises:
        monitor.errors.HistoryError: they do not belong together.
    """
    ordered = sorted(records, key=lambda record: record.experiment)
    experiments = (
        Experiment(record.u, record.y, record.x, record.sampling_period_sec, record.d, record.w) for record in ordered
    )
    return History(tuple(experiments), ordered[0].sampling_period_sec if ordered else math.nan, comparable=True)


class Told(Protocol):
    """A design, as far as it is told."""

    @property
    def kind(self) -> str:
        """Name of the design method."""

    @property
    def accepted(self) -> bool:
        """Whether there is something that runs."""

    @property
    def verdict(self) -> str:
        """One line in plain words."""

    @property
    def document(self) -> str:
        """What it knows about itself, and what it runs, as JSON."""


def design_record(design: Told, source: int, monitor: int) -> DesignRecord:
    """Put a design for the link source → monitor into the form in which it travels."""
    return DesignRecord(
        source=source,
        monitor=monitor,
        observer=design.kind,
        accepted=design.accepted,
        verdict=design.verdict,
        certificate=design.document,
    )


def announced(inputs: tuple[float, float], told: tuple[bool, bool]) -> tuple[float, float]:
    """Inputs with NaN for those that are not announced."""
    load, reference = (value if said else math.nan for value, said in zip(inputs, told, strict=True))
    return load, reference
