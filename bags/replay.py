"""Fresh monitors on a recorded run: the same received outputs, the same or other observers and detectors."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from bags.convert import design_record, history_of
from bags.errors import BagError
from bags.monitors import MonitorArrays, alarm_changes, design_monitors
from bags.origin import SCENARIO_ATTACHMENT
from bags.reader import read_run
from bags.records import AlarmRecord
from bags.run_record import RunRecord
from dgu_sim.scenario import parse_scenario
from monitor.history import History

_MONITOR_SECTION = "monitor."


def replay(run: RunRecord | Path, overrides: Sequence[str] = ()) -> RunRecord:
    """Design the monitors again from the recorded histories and feed them what was received.

    Args:
        run: A recorded run, or its bag.
        overrides: Changes of the scenario's monitor section, "monitor.observer.kind=value" and the like. Without any,
            every residual comes out as recorded, bit for bit.

    Returns:
        The run with the conclusions, designs and alarms of the fresh monitors.

    Raises:
        BagError: The bag cannot be read, or lacks its scenario or a history; an override is not about monitors.
        dgu_sim.errors.ScenarioError: An override does not fit the scenario.
        monitor.errors.MonitorError: Unknown observer or detector, or options of theirs.
    """
    record = run if isinstance(run, RunRecord) else read_run(run)
    for override in overrides:
        if not override.startswith(_MONITOR_SECTION):
            raise BagError(f"override {override!r}: a replay changes only {_MONITOR_SECTION}observer and .detector")
    if not record.scenario_text:
        raise BagError(f"{record.path}: holds no {SCENARIO_ATTACHMENT}, expected the scenario of the run")
    source = f"{record.path}/{SCENARIO_ATTACHMENT}"
    scenario = parse_scenario(record.scenario_text, source=source, overrides=overrides)
    monitors = design_monitors(record.topics, scenario.monitor, histories_of(record))
    _, outputs = monitors.run(monitors.init(), record.received, record.delivered)
    designs = {
        link: design_record(design, link.source, link.target)
        for link, design in zip(record.links, monitors.designs, strict=True)
    }
    return replace(
        record,
        phase=outputs.phase,
        alarm=outputs.alarm,
        estimate=outputs.estimate,
        residual=outputs.residual,
        threshold=outputs.threshold,
        designs=designs,
        alarms=_alarms(record, outputs),
        attachments={**record.attachments, SCENARIO_ATTACHMENT: scenario.to_yaml().encode()},
    )


def histories_of(record: RunRecord) -> dict[int, History]:
    """The recorded history of every DGU that somebody listens to.

    Raises:
        BagError: One is missing or incomplete.
        monitor.errors.HistoryError: Experiments that do not belong together.
    """
    found: dict[int, History] = {}
    for dgu in sorted({link.source for link in record.links}):
        experiments = [one for one in record.histories if one.dgu == dgu]
        announced = experiments[0].experiments if experiments else 1
        if len(experiments) != announced:
            raise BagError(f"{record.path}: {len(experiments)} experiments of DGU {dgu}, expected {announced}")
        found[dgu] = history_of(experiments)
    return found


def _alarms(record: RunRecord, outputs: MonitorArrays) -> tuple[AlarmRecord, ...]:
    quiet = np.zeros(len(record.links), dtype=np.bool_)
    return tuple(
        AlarmRecord(
            step=row,
            source=record.links[position].source,
            monitor=record.links[position].target,
            active=bool(outputs.alarm[row, position]),
            residual=tuple(outputs.residual[row, position].tolist()),
            threshold=tuple(outputs.threshold[row, position].tolist()),
        )
        for row, position in alarm_changes(outputs.alarm, quiet, record.links)
    )
