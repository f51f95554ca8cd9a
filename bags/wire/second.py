"""Messages of second publishers in a bag, and which of them the receivers took."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bags.mcap.yaml_text import load
from bags.wire.records import SecondRecord
from dgu_sim.attacks import KINDS
from dgu_sim.errors import PlugInError
from dgu_sim.grid import Link
from dgu_sim.relay import Action, RelayEvent
from dgu_sim.settings import Accept


def take_newest(
    y: NDArray[Any],
    delivered: NDArray[np.bool_],
    seconds: Iterable[SecondRecord],
    links: Sequence[Link],
    *,
    first_step: int,
    attacks: Mapping[Link, Sequence[tuple[int, int]]],
) -> None:
    """Put what the receivers took in the place of what the links delivered.

    Args:
        y: Received outputs, shape (steps, links, 3).
        delivered: Shape (steps, links).
        seconds: Messages of second publishers, in the order of the bag; the first of a step counts.
        links: The links.
        first_step: Step of the first row.
        attacks: Steps [start, stop) of spoof attacks on each link: what an outsider publishes is never taken.
    """
    done: set[tuple[int, int]] = set()
    for one in seconds:
        row, position = one.step - first_step, links.index(one.link)
        within = any(start <= one.step < stop for start, stop in attacks.get(one.link, ()))
        if within and 0 <= row < len(y) and (row, position) not in done:
            y[row, position], delivered[row, position] = one.y, one.delivered
            done.add((row, position))


def takes_newest(scenario_text: str) -> bool:
    """Whether the receivers of a run took the newest of two messages, by its scenario as YAML."""
    document = load(scenario_text) if scenario_text else None
    receiver = document.get("receiver") if isinstance(document, dict) else None
    return not isinstance(receiver, dict) or receiver.get("accept", Accept.NEWEST) == Accept.NEWEST


def spoofed_steps(events: Iterable[RelayEvent], steps: int) -> dict[Link, list[tuple[int, int]]]:
    """Steps [start, stop) of the attacks of a run that publish themselves, by link."""
    starts: dict[tuple[Link, int], int] = {}
    found: dict[Link, list[tuple[int, int]]] = {}
    for event in events:
        key = event.link, event.attack
        if event.action is Action.START and _publishes(event.kind):
            starts[key] = event.step
        elif key in starts:
            found.setdefault(event.link, []).append((starts.pop(key), event.step))
    for (link, _), start in starts.items():
        found.setdefault(link, []).append((start, steps))
    return found


def _publishes(kind: str) -> bool:
    """Whether attacks of a kind are second publishers; of a kind that is not here, nothing is known."""
    try:
        return KINDS[kind].publishes
    except (KeyError, PlugInError):
        return False
