"""Scenarios, simulated runs, and what recorded runs say."""

from __future__ import annotations

import os
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bags.reporting.options import ReportOptions
from bags.reporting.write import Report, write_report
from bags.runs import reader
from bags.runs import replay as again
from bags.runs.offline import simulate_to_bag
from bags.tables import tabular
from dcmg.api.scenarios import load_scenario
from dgu_sim.scenario import Scenario

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bags.runs.reader import Run
    from bags.runs.run_record import RunRecord


def simulate(
    scenario: Scenario | str | os.PathLike[str],
    out: str | os.PathLike[str] | None = None,
    *,
    overrides: Sequence[str] = (),
) -> RunRecord:
    """Run a scenario without ROS: plant, attacks and monitors; bit for bit what the nodes compute.

    Args:
        scenario: a scenario, the name of a shipped one, or the path of a file.
        out: the bag to write, which must not exist; None: the run is only returned.
        overrides: changes, "a.b=value", when the scenario is named.

    Returns:
        The run as arrays: states x (steps, DGUs, 3) [V, A, V s], residuals (steps, links, 3), alarms (steps, links), …

    Raises:
        ScenarioError: the scenario is not valid.
        MonitorError: its monitors are not.
        BagError: the bag cannot be written.
    """
    loaded = scenario if isinstance(scenario, Scenario) else load_scenario(scenario, overrides)
    if out is not None:
        return reader.read_run(simulate_to_bag(loaded, Path(out)))
    with tempfile.TemporaryDirectory() as folder:
        return replace(reader.read_run(simulate_to_bag(loaded, Path(folder) / "bag")), path=Path(loaded.name))


def open_run(bag: str | os.PathLike[str]) -> Run:
    """Open a recorded run; its steps are read by `windows()`, some at a time.

    Raises:
        BagError: it is no bag of a run, or damaged.
    """
    return reader.open_run(Path(bag))


def read_run(bag: str | os.PathLike[str]) -> RunRecord:
    """Read a recorded run into memory, as arrays.

    Raises:
        BagError: it is no bag of a run, or damaged.
    """
    return reader.read_run(Path(bag))


def replay(run: RunRecord | str | os.PathLike[str], overrides: Sequence[str] = ()) -> RunRecord:
    """Feed what was received to freshly designed monitors.

    Args:
        run: a run that was read, or its bag.
        overrides: changes of the monitor section, "monitor.detector={kind: cusum}" and the like. Without any, every
            residual comes out as recorded, bit for bit.

    Raises:
        BagError: the bag cannot be read, or lacks its scenario or a history.
        ScenarioError: an override does not fit.
        MonitorError: unknown observer or detector, or options of theirs.
    """
    return again.replay(Path(run) if isinstance(run, (str, os.PathLike)) else run, overrides)


def report(
    bag: str | os.PathLike[str],
    out: str | os.PathLike[str] | None = None,
    **choices: Any,  # noqa: ANN401 (checked there)
) -> Report:
    """Measure a run and write report.html and report.json.

    Args:
        bag: the run.
        out: folder to write to; None: the bag's name and `_report`.
        choices: fields of `ReportOptions`: level, seed, block_sec, aftermath_sec, …

    Raises:
        BagError: the bag cannot be read, or the folder not be written.
    """
    run = open_run(bag)
    path = Path(bag)
    folder = path.with_name(f"{path.resolve().name}_report") if out is None else Path(out)
    return write_report(run.windows(), run.steps, folder, ReportOptions(**choices))


def dataset(run: Run | str | os.PathLike[str]) -> Any:  # noqa: ANN401 (xarray is optional)
    """Read a run as an `xarray.Dataset` with the dimensions step, dgu, link and component, and units.

    Args:
        run: an opened run, or its bag.

    Raises:
        BagError: the bag cannot be read, or xarray is not installed (`pip install "dcmg[tables]"`).
    """
    return tabular.dataset(open_run(run) if isinstance(run, (str, os.PathLike)) else run)
