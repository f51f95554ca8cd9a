"""What would have become of the grid if no DGU had acted on a verdict."""

from dataclasses import fields

from bags.mcap.errors import BagError
from bags.reporting.timeline import Timeline
from bags.runs.avoided import without_response
from bags.wire.settings import settings_of
from dgu_sim.commands import AttackCommand
from dgu_sim.errors import DguSimError
from dgu_sim.relay import Origin
from dgu_sim.scenario import parse_scenario
from monitor.measures import GridImpact


def unanswered(timeline: Timeline) -> GridImpact | None:
    """Simulate the run of a bag again without its response; None where there was none, or where it cannot be told.

    It cannot when something was commanded by hand (the scenario does not know it), when the bag has no truth to compare
    with, or when the scenario refers to a bag of histories that is gone.
    """
    run = timeline.run
    told = any(isinstance(one.command, AttackCommand) for one in run.commands)
    by_hand = not told and any(attack.origin != Origin.SCENARIO.value for attack in timeline.attacks)
    if not run.scenario_text or not timeline.truth or by_hand:
        return None
    try:
        scenario = parse_scenario(run.scenario_text)
        if [(one.step, one.command) for one in run.commands] != list(scenario.orders.by_step):
            return None
        if settings_of(scenario).response is None or scenario.steps < timeline.steps:
            return None
        found = without_response(scenario)
    except (BagError, DguSimError):
        return None
    return GridImpact(**{one.name: getattr(found, one.name)[: timeline.steps] for one in fields(found)})
