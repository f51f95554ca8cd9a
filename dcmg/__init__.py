"""The front door: the public API, the `dcmg` command, scenarios, studies, the papers: everything that needs no ROS.

    import dcmg

    run = dcmg.simulate("gallo_six_dgu", overrides=["duration_sec=6"])
    made = dcmg.design(y=y, x=x, sampling_period_sec=0.01, unknown_inputs=2)

Names are imported when they are first used: `import dcmg` itself costs nothing. docs/api.md shows each at work.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bags.mcap.errors import BagError
    from bags.reporting.write import Report
    from bags.runs.reader import Run
    from bags.runs.run_record import RunRecord
    from bags.watch.scenarios import parse_scenario
    from dcmg.api.data import design, detector, history, run_detector, run_observer
    from dcmg.api.figures import plot, save_figure
    from dcmg.api.runs import dataset, open_run, read_run, replay, report, simulate
    from dcmg.api.scenarios import load_scenario
    from dcmg.errors import CommandError
    from dcmg.shipped import shipped_scenarios
    from dgu_sim.errors import AttackError, DguSimError, ScenarioError
    from dgu_sim.grid import Link
    from dgu_sim.scenario import Scenario
    from monitor.batch import Estimates
    from monitor.certificate import Certificate
    from monitor.detectors.batch import Alarms
    from monitor.detectors.protocol import Detector, matched
    from monitor.errors import HistoryError, MonitorError
    from monitor.history import Experiment, History
    from monitor.observer import Design, Observer

__all__ = [
    "Alarms",
    "AttackError",
    "BagError",
    "Certificate",
    "CommandError",
    "Design",
    "Detector",
    "DguSimError",
    "Estimates",
    "Experiment",
    "History",
    "HistoryError",
    "Link",
    "MonitorError",
    "Observer",
    "Report",
    "Run",
    "RunRecord",
    "Scenario",
    "ScenarioError",
    "dataset",
    "design",
    "detector",
    "history",
    "load_scenario",
    "matched",
    "open_run",
    "parse_scenario",
    "plot",
    "read_run",
    "replay",
    "report",
    "run_detector",
    "run_observer",
    "save_figure",
    "shipped_scenarios",
    "simulate",
]

_NAMES = {
    "bags.mcap.errors": ("BagError",),
    "bags.reporting.write": ("Report",),
    "bags.runs.reader": ("Run",),
    "bags.runs.run_record": ("RunRecord",),
    "dcmg.api.data": ("design", "detector", "history", "run_detector", "run_observer"),
    "dcmg.api.figures": ("plot", "save_figure"),
    "dcmg.api.runs": ("dataset", "open_run", "read_run", "replay", "report", "simulate"),
    "dcmg.api.scenarios": ("load_scenario",),
    "dcmg.errors": ("CommandError",),
    "dcmg.shipped": ("shipped_scenarios",),
    "dgu_sim.errors": ("AttackError", "DguSimError", "ScenarioError"),
    "dgu_sim.grid": ("Link",),
    "bags.watch.scenarios": ("parse_scenario",),
    "dgu_sim.scenario": ("Scenario",),
    "monitor.batch": ("Estimates",),
    "monitor.certificate": ("Certificate",),
    "monitor.detectors.batch": ("Alarms",),
    "monitor.detectors.protocol": ("Detector", "matched"),
    "monitor.errors": ("HistoryError", "MonitorError"),
    "monitor.history": ("Experiment", "History"),
    "monitor.observer": ("Design", "Observer"),
}
_WHERE = {name: module for module, names in _NAMES.items() for name in names}

if not TYPE_CHECKING:  # a type checker shall know the names, and no others

    def __getattr__(name: str) -> object:
        """Import a name when it is first asked for (PEP 562)."""
        if name not in _WHERE:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(_WHERE[name]), name)


def __dir__() -> list[str]:
    """List the public names for completion in an interpreter."""
    return list(__all__)
