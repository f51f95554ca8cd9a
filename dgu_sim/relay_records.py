"""What the relay schedules, remembers and reports."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from dgu_sim.attacks import Attack
from dgu_sim.grid import Link
from dgu_sim.records import Sample

__all__ = ["Action", "AttackPlan", "Origin", "RelayEvent", "RelayState", "RunningAttack", "Spoofing"]


class Action(StrEnum):
    """What an event says."""

    START = "start"
    STOP = "stop"


class Origin(StrEnum):
    """Who asked for an attack."""

    SCENARIO = "scenario"
    SERVICE = "service"


@dataclass(frozen=True, slots=True, kw_only=True)
class AttackPlan:
    """An attack that the scenario schedules.

    Attributes:
        links: The links it acts on together.
        kind: Name of the attack class.
        parameters: Its parameters, checked.
        start_sec: Time of the first affected sample [s].
        stop_sec: Time of the first clean sample again [s]; None: it stays.
    """

    links: tuple[Link, ...]
    kind: str
    parameters: Mapping[str, object]
    start_sec: float
    stop_sec: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class RelayEvent:
    """An attack starts or stops acting on one link.

    Attributes:
        step: First affected sample (START) or first clean one (STOP).
        attack: Number of the attack within the run, from 1.
        link: The link.
        action: START or STOP.
        kind: Name of the attack class.
        parameters: JSON object with its parameters, keys sorted.
        origin: Who asked for it.
    """

    step: int
    attack: int
    link: Link
    action: Action
    kind: str
    parameters: str
    origin: Origin


@dataclass(frozen=True, slots=True, kw_only=True)
class RunningAttack:
    """An attack that is scheduled or active.

    Attributes:
        number: Number within the run, from 1.
        links: The links it acts on.
        positions: Their positions among the relay's links.
        kind: Name of the attack class.
        parameters: JSON object with its parameters.
        origin: Who asked for it.
        attack: The attack.
        state: Its state.
        start_step: First affected sample.
        stop_step: First clean sample again; None: until stopped.
        asked_step: The next step to relay when it was asked for.
    """

    number: int
    links: tuple[Link, ...]
    positions: tuple[int, ...]
    kind: str
    parameters: str
    origin: Origin
    attack: Attack
    state: object
    start_step: int
    stop_step: int | None
    asked_step: int

    def announced(self, step: int) -> tuple[Link, ...]:
        """Return the links whose START event is out before `step` is relayed: a service hears of the first at once."""
        if self.start_step < step:
            return self.links
        at_once = self.origin is Origin.SERVICE and self.asked_step == self.start_step
        return self.links[:1] if self.start_step == step and at_once else ()

    def event(self, link: Link, action: Action, step: int) -> RelayEvent:
        """Return the event of one link."""
        return RelayEvent(
            step=step,
            attack=self.number,
            link=link,
            action=action,
            kind=self.kind,
            parameters=self.parameters,
            origin=self.origin,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Spoofing:
    """Steps in which a link carries the messages of a second publisher, too.

    Attributes:
        link: The link.
        first_step: The first of them.
        end_step: One past the last; None: until stopped.
    """

    link: Link
    first_step: int
    end_step: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class RelayState:
    """Where the relay is.

    Attributes:
        step: The next step to relay.
        attacks: Scheduled and active attacks, by number.
        next_number: Number of the next attack.
        spoofed: What second publishers sent at the step just relayed: position of the link and sample, ascending.
    """

    step: int
    attacks: tuple[RunningAttack, ...]
    next_number: int
    spoofed: tuple[tuple[int, Sample], ...] = ()
