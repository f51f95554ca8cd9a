"""What is checked before a run starts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bags.watch.histories import histories_of_run
from bags.wire.convert import history_of
from dcmg.commands.showing import messages
from monitor import detectors, observers

if TYPE_CHECKING:
    from dgu_sim.scenario import Scenario


def check_monitors(scenario: Scenario) -> None:
    """Design every observer and build the detector once, so that a run does not start in vain.

    Raises:
        MonitorError: an unknown kind or option, or a history that cannot be used.
        BagError: the bag of histories cannot be read.
    """
    detector, observer = scenario.monitor.detector, scenario.monitor.observer
    detectors.build(detector.kind, detector.options, scenario.sampling_period_sec)
    for source in sorted({link.source for link in scenario.links}):
        history = history_of(histories_of_run(scenario, source))
        design = observers.design(observer.kind, history, observer.options)
        if not design.accepted:
            messages.print(f"[yellow]links from DGU {source} are not monitored[/]: {design.verdict}", soft_wrap=True)
    if scenario.monitor.team is not None:
        from bags.watch.team import design_of  # noqa: PLC0415 (heavy)

        team = design_of(scenario)
        if not team.accepted:
            messages.print(f"[yellow]no team[/]: {team.verdict}", soft_wrap=True)
