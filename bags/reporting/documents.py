"""The JSON documents of a run: what `dcmg run`, `simulate` and `replay` print, and the larger one of a report."""

from dataclasses import fields
from pathlib import Path
from typing import Any

from bags.mcap.yaml_text import load
from bags.reporting.assessment import Assessment
from bags.reporting.judged import Judged
from bags.reporting.making import making_of
from bags.reporting.plain import plain
from bags.reporting.timeline import Timeline
from monitor.measures import AlarmRates


def run_document(timeline: Timeline, judged: Judged, bag: Path | None = None) -> dict[str, Any]:
    """A run in its rows; every number is finite, null stands for none.

    Args:
        timeline: The run, gathered.
        judged: Its rows.
        bag: What to give as the bag's path, if not the run's own.
    """
    scenario = load(timeline.run.scenario_text) if timeline.run.scenario_text else None
    told = scenario if isinstance(scenario, dict) else {}
    team = {} if timeline.team is None else {"team": timeline.team.document()}
    return {
        "scenario": str(told.get("name", "")),
        "seed": told.get("seed") if isinstance(told.get("seed"), int) else None,
        "steps": timeline.steps,
        "sampling_period_sec": timeline.period_sec,
        "duration_sec": timeline.duration_sec,
        "labelled": timeline.labelled,
        "judged_by": judged.main,
        "attacks": [row.document() for row in judged.attacks],
        "links": [row.document(labelled=timeline.labelled) for row in judged.links],
        "commands": [{"step": one.step, **one.command.document()} for one in timeline.run.commands],
        **team,
        "bag": str(timeline.run.path if bag is None else bag),
    }


def report_document(timeline: Timeline, assessment: Assessment) -> dict[str, Any]:
    """The rows of a run and every measure of its report."""
    making = making_of(timeline.run, timeline.steps)
    found = run_document(timeline, assessment.judged)
    impacts = {one.row.attack.number: one for one in assessment.attacks}
    for row in found["attacks"]:
        if (one := impacts.get(row["number"])) is not None:
            row |= {"impact": plain(one.impact), "unanswered": plain(one.unanswered)}
    measured = ("roc", "batadal", "left_out_sec", "clear_errors", "attacked_errors")
    for row, link in zip(found["links"], assessment.links, strict=True):
        rates = _rates(link.rates, labelled=timeline.labelled)
        row |= {"rates": rates, **{name: plain(getattr(link, name)) for name in measured}}
    return {
        **found,
        "truth": timeline.truth,
        "made": dict(making.facts),
        "designs": plain(making.designs),
        "options": plain(assessment.options),
        "overall": {
            name: {
                "missed": plain(one.missed),
                "delay_sec": plain(one.delay_sec),
                "rates": _rates(one.rates, labelled=timeline.labelled),
                "batadal": plain(one.batadal),
                "isolation": plain(one.isolation),
            }
            for name, one in assessment.overall.items()
        },
    }


def _rates(rates: AlarmRates, *, labelled: bool) -> dict[str, object]:
    """Rates by name; where nobody knows what was attacked, an alarm is an alarm and not a false one."""
    return {
        one.name if labelled else one.name.removeprefix("false_"): plain(getattr(rates, one.name))
        for one in fields(rates)
    }
