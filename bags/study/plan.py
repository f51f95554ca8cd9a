"""What a study will cost, from what one cell of each kind costs here."""

import resource
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from bags.study.cells import StudyCell
from bags.study.evaluate import SCHEMA, evaluate
from bags.study.parts import Parts, as_part
from bags.study.runs import RUN_BYTES, runs_of

_HOUR_SEC = 3600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What a study costs, computed from measured cells.

    Attributes:
        cells: How many.
        run_steps: Steps of all runs.
        worker_sec: CPU time of all cells [s].
        collector_sec: CPU time of the process that checks, writes and sums up all parts [s].
        table_bytes: Size of the table.
        worker_bytes: Largest memory of a process that computed a cell of each kind one after the other.
        summary_bytes: What is held of one condition and observer while it is summed up.
    """

    cells: int
    run_steps: int
    worker_sec: float
    collector_sec: float
    table_bytes: float
    worker_bytes: int
    summary_bytes: int

    @property
    def most_workers(self) -> float:
        """So many workers give the collecting process as much as it can take."""
        return self.worker_sec / self.collector_sec

    def rows(self, workers: int) -> Iterator[tuple[str, str]]:
        """Yield what to print for a number of workers: name and value."""
        yield "cells", f"{self.cells:,}"
        yield "run-steps", f"{self.run_steps:.3g}"
        yield "CPU per million run-steps", f"{self.worker_sec / self.run_steps * 1e6:.3g} s"
        yield "CPU of a cell", f"{self.worker_sec / self.cells:.3g} s"
        yield "CPU of all cells", f"{self.worker_sec / _HOUR_SEC:.3g} h"
        yield f"time on {workers} workers", f"{max(self.worker_sec / workers, self.collector_sec) / _HOUR_SEC:.3g} h"
        yield "memory of a worker", f"{self.worker_bytes / 1e6:.0f} MB"
        yield "collecting a cell", f"{self.collector_sec / self.cells * 1e3:.3g} ms"
        yield "collecting all cells", f"{self.collector_sec / _HOUR_SEC:.3g} h"
        yield "collecting is the limit from", f"{self.most_workers:.0f} workers"
        yield "memory of the summary", f"{self.summary_bytes / 1e6:.0f} MB"
        yield "table", f"{self.table_bytes / 1e6:.3g} MB"


def plan_of(cells: Sequence[StudyCell]) -> Plan:
    """Compute the first cell of each condition and observer, and infer what all cost.

    Raises:
        monitor.errors.MonitorError: Wrong options of an observer.
    """
    kinds: dict[tuple[str, str], list[StudyCell]] = {}
    for cell in cells:
        kinds.setdefault((cell.condition, cell.observer.name), []).append(cell)
    evaluate(cells[0])  # what is imported and built at first does not count
    worker = collector = table = 0.0
    with tempfile.TemporaryDirectory() as folder:
        parts = Parts(Path(folder), SCHEMA)
        for several in kinds.values():
            share = sum(len(one.seeds) for one in several) / len(several[0].seeds)  # of full cells
            began = time.process_time()
            data = as_part(several[0].key, evaluate(several[0]))
            computed = time.process_time()
            _collect(parts, several[0].key, data)
            worker += share * (computed - began)
            collector += share * (time.process_time() - computed)
            table += share * len(data)
    return Plan(
        cells=len(cells),
        run_steps=sum(len(cell.seeds) * scenario.steps for cell in cells for scenario in cell.scenarios.values()),
        worker_sec=worker,
        collector_sec=collector,
        table_bytes=table,
        worker_bytes=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
        summary_bytes=max(map(_summary_bytes, kinds.values())),
    )


def _collect(parts: Parts, key: str, data: bytes) -> None:
    """What is done with a part on its way into the comparison: it is written, checked, read and reduced to runs."""
    parts.write(key, data)
    parts.read(key)
    for _ in runs_of(parts.read(key)):
        pass


def _summary_bytes(cells: Sequence[StudyCell]) -> int:
    points = sum(len(one.points) for one in cells[0].detectors)
    return RUN_BYTES * points * len(cells[0].scenarios) * sum(len(one.seeds) for one in cells)
