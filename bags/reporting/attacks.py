"""The attacks of a run: as its events tell them, and those of its scenario that never began."""

import math
from dataclasses import dataclass
from typing import Any

from bags.mcap.yaml_text import load
from bags.runs.run_record import RunRecord
from dgu_sim.errors import AttackError
from dgu_sim.grid import Link
from dgu_sim.relay import Action, Origin, RelayEvent
from dgu_sim.signals import first_step
from monitor.measures import spans


@dataclass(frozen=True, slots=True, kw_only=True)
class Attack:
    """One attack, on one or several links.

    Attributes:
        number: As in its events.
        kind: Its class.
        parameters: JSON document.
        origin: Who started it: the scenario or a service.
        links: Attacked links, in the order of the run's links.
        start_step: First falsified sample; of one that never began, the one that was planned.
        stop_step: First clean sample behind it; the end of the run when it never stopped.
        stopped: Whether it stopped before the run ended.
    """

    number: int
    kind: str
    parameters: str
    origin: str
    links: tuple[Link, ...]
    start_step: int
    stop_step: int
    stopped: bool

    @property
    def began(self) -> bool:
        """Whether it falsified a sample of the run."""
        return self.stop_step > self.start_step


def attacks_of(run: RunRecord, steps: int) -> tuple[Attack, ...]:
    """All attacks, by start.

    Args:
        run: A window of the run.
        steps: Complete steps of the run.
    """
    by_number: dict[int, list[RelayEvent]] = {}
    for event in run.events:
        if event.attack in by_number or event.action is Action.START:
            by_number.setdefault(event.attack, []).append(event)
    found = [_told(number, events, run, steps) for number, events in by_number.items()]
    found += [one for one in _planned(run) if one.number not in by_number and one.start_step >= steps]
    return tuple(sorted(found, key=lambda one: (one.start_step, one.number)))


def _told(number: int, events: list[RelayEvent], run: RunRecord, steps: int) -> Attack:
    lasted = spans(((one.step, one.link, one.action is Action.START) for one in events), steps)
    start = min(start for spent in lasted.values() for start, _ in spent)
    stop = min(max(stop for spent in lasted.values() for _, stop in spent), steps)
    ended = {event.link for event in events if event.action is Action.STOP and event.step < steps}
    return Attack(
        number=number,
        kind=events[0].kind,
        parameters=events[0].parameters,
        origin=events[0].origin.value,
        links=tuple(link for link in run.links if link in lasted),
        start_step=start,
        stop_step=max(stop, start),
        stopped=ended >= set(lasted),
    )


def _planned(run: RunRecord) -> list[Attack]:
    """The attacks that the scenario in the bag schedules; the relay numbers them first, in their order."""
    document = load(run.scenario_text) if run.scenario_text else None
    plans = document.get("attacks") if isinstance(document, dict) else None
    found = []
    for number, plan in enumerate(plans if isinstance(plans, list) else (), start=1):
        start_sec = plan.get("start_sec") if isinstance(plan, dict) else None
        if not isinstance(start_sec, int | float) or not math.isfinite(start_sec):
            continue  # a scenario of another version
        start = first_step(start_sec, run.sampling_period_sec)
        links = set(_links(plan))
        found.append(
            Attack(
                number=number,
                kind=str(plan.get("kind")),
                parameters="{}",
                origin=Origin.SCENARIO.value,
                links=tuple(link for link in run.links if link in links),
                start_step=start,
                stop_step=start,
                stopped=False,
            )
        )
    return found


def _links(plan: dict[str, Any]) -> list[Link]:
    try:
        return [Link.parse(str(name)) for name in plan.get("links") or [plan.get("link")]]
    except AttackError:
        return []
