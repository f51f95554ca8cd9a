"""The attacks of a run as its events tell them."""

from dataclasses import dataclass
from typing import final

from bags.runs.run_record import RunRecord
from dgu_sim.grid import Link
from dgu_sim.relay import Action


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Attack:
    """One attack, on one or several links.

    Attributes:
        number: As in its events.
        kind: Its class.
        parameters: JSON document.
        origin: Who started it: the scenario or a service.
        links: Attacked links, in the order of the run's links.
        start_step: First falsified sample.
        stop_step: First clean sample behind it; the end of the run when it never stopped.
    """

    number: int
    kind: str
    parameters: str
    origin: str
    links: tuple[Link, ...]
    start_step: int
    stop_step: int


def attacks_of(run: RunRecord, steps: int) -> tuple[Attack, ...]:
    """All attacks, by start.

    Args:
        run: A window of the run.
        steps: Complete steps of the run.
    """
    found = []
    for number in sorted({event.attack for event in run.events if event.action is Action.START}):
        events = [event for event in run.events if event.attack == number]
        starts = [event for event in events if event.action is Action.START]
        stops = {event.link: event.step for event in events if event.action is Action.STOP}
        links = {event.link for event in starts}
        start = min(event.step for event in starts)
        found.append(
            Attack(
                number=number,
                kind=starts[0].kind,
                parameters=starts[0].parameters,
                origin=starts[0].origin.value,
                links=tuple(link for link in run.links if link in links),
                start_step=start,
                stop_step=max(stops.get(link, steps) for link in links),
            )
        )
    return tuple(sorted(found, key=lambda one: (one.start_step, one.number)))
