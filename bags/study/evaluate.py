"""The work of one cell: simulate, design, watch, and one row for every link of every run and operating point.

Runs, attacks and links stand side by side on one axis of "lanes", so that one pass of the observer's multiply-adds
serves them all, and one of each detector's: the same code, and so the same bits, as in a run.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeAlias

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from bags.study.cells import StudyCell
from bags.study.combined import Signals, conclude
from bags.study.designs import designs_of
from bags.study.judging import Concluded, LinkResiduals, Received
from bags.study.settings import NO_ATTACK
from bags.watch.designs import RunDesigns
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import simulate
from monitor.link_design import LinkDesign
from monitor.measures import GridImpact, grid_impact, onsets
from monitor.settings import DetectorSettings

SCHEMA = pa.schema(
    [
        ("condition", pa.string()),
        ("observer", pa.string()),
        ("detector", pa.string()),
        ("swept", pa.float64()),  # value of the swept option; null at the detector's own operating point
        ("attack", pa.string()),
        ("seed", pa.int64()),
        ("source", pa.int32()),
        ("target", pa.int32()),
        ("attacked", pa.bool_()),
        ("accepted", pa.bool_()),
        ("verdict", pa.string()),
        ("clean_steps", pa.int64()),  # armed, and no attack in the run so far; the whole run without an attack
        ("clean_alarm_steps", pa.int64()),
        ("clean_alarms", pa.int64()),  # onsets among them
        ("attack_steps", pa.int64()),  # in the window of the attack: in runs without one, the window it would have
        ("attack_alarm_steps", pa.int64()),
        ("detected", pa.bool_()),  # an alarm in that window; on a link that is not attacked: a wrong accusation
        ("delay_sec", pa.float64()),
        ("residual_before", pa.float64()),  # largest |r| of any component while armed
        ("residual_after", pa.float64()),
        ("mean_voltage_v", pa.float64()),  # largest impact of the run, and that until an attacked link alarmed
        ("mean_voltage_until_alarm_v", pa.float64()),
        ("voltage_v", pa.float64()),
        ("voltage_until_alarm_v", pa.float64()),
        ("sharing", pa.float64()),
        ("sharing_until_alarm", pa.float64()),
    ]
)
"""Columns of the table of a study."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Runs:
    """All runs of one scenario, one for each seed.

    Attributes:
        sent: y, shape (steps, seeds, DGUs, 3).
        reference: V_ref + alpha, shape (steps, seeds, DGUs) [V].
        received: Shape (steps, seeds, links, 3).
        delivered: Shape (steps, seeds, links).
        lying: Where somebody else speaks on a link, shape (steps, seeds, links).
        impact: Largest distance of the grid from its goals up to each step, from the attack's start on, (steps, seeds).
        attacked: Whether each link is attacked, shape (links,).
        clean: First step that is not free of attacks.
    """

    sent: NDArray[np.float64]
    reference: NDArray[np.float64]
    received: NDArray[np.float64]
    delivered: NDArray[np.bool_]
    lying: NDArray[np.bool_]
    impact: GridImpact
    attacked: NDArray[np.bool_]
    clean: int


def evaluate(cell: StudyCell) -> pa.Table:
    """Do the work of one cell.

    Returns:
        One row for each detector's operating point, attack, seed and link; columns as in SCHEMA.

    Raises:
        monitor.errors.MonitorError: Wrong options of the observer.
    """
    base = cell.scenarios[NO_ATTACK]
    window = _window(tuple(cell.scenarios.values())[-1])
    runs = {attack: _simulated(scenario, cell.seeds) for attack, scenario in cell.scenarios.items()}
    designs = [designs_of(cell.observer, base.model_copy(update={"seed": seed})) for seed in cell.seeds]
    lanes = [link for one in designs for link in one.links]
    judge = (_watch_all if designs[0].settings.combined else _watch_links)(tuple(runs.values()), designs)
    tables = []
    for detector in cell.detectors:
        for swept in detector.points:
            concluded = judge(detector.at(swept))
            for position, (attack, one) in enumerate(runs.items()):
                judged = _judge(one, _Part.of(concluded, position), window, base.sampling_period_sec)
                point = {"detector": detector.name, "swept": swept, "attack": attack}
                tables.append(_table(cell, point, one, judged, lanes))
    return pa.concat_tables(tables)


_Judging: TypeAlias = Callable[[DetectorSettings], Concluded]
"""What the monitors of all runs of a cell conclude under a detector."""


def _watch_links(runs: Sequence[_Runs], designs: Sequence[RunDesigns]) -> _Judging:
    """Let the observers of all links run once."""
    residuals = LinkResiduals.of([Received(one.received, one.delivered) for one in runs], designs)
    return lambda detector: residuals.judged_by(designs[0].judged_by(detector).detector)


def _watch_all(runs: Sequence[_Runs], designs: Sequence[RunDesigns]) -> _Judging:
    """Let the combined monitors run: a detector's alarm is one of the tests that they draw their conclusion from."""

    def judged_by(detector: DetectorSettings) -> Concluded:
        by_seed = []
        for position, one in enumerate(designs):
            signals = [np.stack([getattr(run, name)[:, position] for run in runs], axis=1) for name in Signals._fields]
            by_seed.append(conclude(one.judged_by(detector), Signals(*signals)))
        return Concluded(*(np.stack(each, axis=2) for each in zip(*by_seed, strict=True)))

    return judged_by


@dataclass(frozen=True, slots=True, kw_only=True)
class _Part:
    """What the monitors concluded in the runs of one scenario, shapes (steps, seeds, links).

    Attributes:
        alarm: Verdicts.
        armed: Whether there is one.
        size: Largest |r| of any component while armed, else 0.
    """

    alarm: NDArray[np.bool_]
    armed: NDArray[np.bool_]
    size: NDArray[np.float64]

    @classmethod
    def of(cls, concluded: Concluded, position: int) -> "_Part":
        """Cut one scenario out of what was concluded in all runs."""
        armed = concluded.armed[:, position]
        return cls(
            alarm=concluded.alarm[:, position], armed=armed, size=np.where(armed, concluded.size[:, position], 0.0)
        )


def _window(scenario: Scenario) -> tuple[int, int]:
    """Return the steps [start, stop) of a scenario's attack; without one the end of the run."""
    if not scenario.attacks:
        return scenario.steps, scenario.steps
    plan = scenario.attacks[0].plan
    stop_sec = scenario.duration_sec if plan.stop_sec is None else plan.stop_sec
    times = (plan.start_sec, min(stop_sec, scenario.duration_sec))
    start, stop = (round(time / scenario.sampling_period_sec) for time in times)
    return start, stop


def _simulated(scenario: Scenario, seeds: Sequence[int]) -> _Runs:
    blocks = list(simulate(scenario, seeds=seeds))
    links = [link for one in scenario.attacks for link in one.plan.links]
    clean, _ = _window(scenario)
    lying = np.zeros((scenario.steps, len(seeds), len(scenario.links)), dtype=np.bool_)
    for one in (one for block in blocks for one in block.doubled):
        lying[one.step, :, one.position] = True
    return _Runs(
        sent=np.concatenate([block.y for block in blocks]),
        reference=np.concatenate([block.reference for block in blocks]),
        received=np.concatenate([block.received for block in blocks]),
        delivered=np.concatenate([block.delivered for block in blocks]),
        lying=lying,
        impact=_impact_so_far(scenario, np.concatenate([block.x for block in blocks]), clean if links else 0),
        attacked=np.array([link in links for link in scenario.links]),
        clean=clean,
    )


def _impact_so_far(scenario: Scenario, x: NDArray[np.float64], start: int) -> GridImpact:
    """Largest distance from the goals up to each step that counts; x has the shape (steps, runs, DGUs, 3)."""
    nominal = np.array([one.reference_v for one in scenario.dgus])
    rated = np.array([one.rated_current_a for one in scenario.dgus])
    found = grid_impact(x[..., 0], x[..., 1], nominal, rated)

    def so_far(signal: NDArray[np.float64]) -> NDArray[np.float64]:
        counted = np.abs(signal)
        counted[:start] = 0.0
        return np.asarray(np.maximum.accumulate(counted, axis=0))

    return GridImpact(**{one.name: so_far(getattr(found, one.name)) for one in fields(found)})


def _judge(runs: _Runs, part: _Part, window: tuple[int, int], period_sec: float) -> dict[str, NDArray[Any]]:
    """Return the columns that follow from what the monitors concluded, each of shape (seeds, links)."""
    start, stop = window
    last = len(part.alarm) - 1
    during, clean = part.alarm[start:stop], part.alarm[: runs.clean]
    detected = np.asarray(during.any(axis=0))
    first = np.where(detected, start + (during.argmax(axis=0) if len(during) else 0), last)
    columns: dict[str, NDArray[Any]] = {
        "clean_steps": part.armed[: runs.clean].sum(axis=0),
        "clean_alarm_steps": clean.sum(axis=0),
        "clean_alarms": onsets(clean).sum(axis=0),
        "attack_steps": np.full(detected.shape, stop - start),
        "attack_alarm_steps": during.sum(axis=0),
        "detected": detected,
        "delay_sec": np.where(detected, (first - start) * period_sec, np.nan),
        "residual_before": part.size[:start].max(axis=0, initial=0.0),
        "residual_after": part.size[start:].max(axis=0, initial=0.0),
    }
    unnoticed = np.full((len(detected), 1), last)  # also where nothing is attacked
    until = np.hstack([first[:, runs.attacked], unnoticed]).min(axis=1)
    columns |= _impact_columns(runs.impact, until, detected.shape)
    return columns


def _impact_columns(impact: GridImpact, until: NDArray[np.int64], shape: tuple[int, ...]) -> dict[str, NDArray[Any]]:
    """Return the impact of each run, repeated for its links."""
    columns = {}
    for name, unit in (("mean_voltage", "_v"), ("voltage", "_v"), ("sharing", "")):
        signal = getattr(impact, name)
        columns[f"{name}{unit}"] = np.broadcast_to(signal[-1][:, None], shape)
        at_alarm = signal[until, np.arange(len(until))]
        columns[f"{name}_until_alarm{unit}"] = np.broadcast_to(at_alarm[:, None], shape)
    return columns


def _table(
    cell: StudyCell,
    point: Mapping[str, object],
    runs: _Runs,
    judged: Mapping[str, NDArray[Any]],
    lanes: Sequence[LinkDesign],
) -> pa.Table:
    links = cell.scenarios[NO_ATTACK].links
    rows = len(cell.seeds) * len(links)
    columns: dict[str, Any] = {
        "condition": [cell.condition] * rows,
        "observer": [cell.observer.name] * rows,
        **{name: [value] * rows for name, value in point.items()},
        "seed": np.repeat(cell.seeds, len(links)),
        "source": [link.source for link in links] * len(cell.seeds),
        "target": [link.target for link in links] * len(cell.seeds),
        "attacked": np.tile(runs.attacked, len(cell.seeds)),
        "accepted": [lane.observer is not None and not lane.blind for lane in lanes],
        "verdict": [lane.verdict for lane in lanes],
        **{name: values.reshape(-1) for name, values in judged.items()},
    }
    return pa.table({field.name: columns[field.name] for field in SCHEMA}, schema=SCHEMA)
