"""What is designed and checked before a run starts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.markup import escape

from bags.watch.carried import read_carried
from bags.watch.designs import design_scenario, said_of
from dcmg.commands.showing import messages
from dcmg.shipped import scenario_path

if TYPE_CHECKING:
    from pathlib import Path

    from bags.watch.designs import RunDesigns
    from dcmg.commands.scenario_options import ScenarioOptions
    from dgu_sim.scenario import Scenario


def check_monitors(scenario: Scenario, chosen: ScenarioOptions, designs: Path | None = None) -> RunDesigns:
    """Design everything that the monitors run and put it together once, so that a run does not start in vain.

    Args:
        scenario: what is to run.
        chosen: where it was read from.
        designs: bag whose designs are taken where they fit, None: everything is designed.

    Raises:
        ScenarioError: an unknown kind or option, or one that does not fit.
        MonitorError: a history that cannot be used.
        BagError: the bag of histories, or that of designs, cannot be read.
    """
    carried = None if designs is None else read_carried(designs)
    with said_of(str(scenario_path(chosen.name)), chosen.changes):
        found = design_scenario(scenario, carried=carried)
        found.check_start()
    reasons: dict[str, list[str]] = {}
    for name, verdict in found.refusals:
        reasons.setdefault(verdict, []).append(name)
    for verdict, names in reasons.items():
        messages.print(f"[yellow]not watched[/]: {', '.join(names)}: {escape(verdict)}", soft_wrap=True)
    if carried is not None:
        anew = carried.anew(found.told())
        if anew:
            messages.print(
                f"[yellow]designed anew[/], {escape(str(designs))} does not fit: {', '.join(anew)}", soft_wrap=True
            )
    return found
