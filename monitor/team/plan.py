"""What a team is told besides data: who is in it, who hears whom, who comes and goes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from monitor.distributed import linked

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from monitor.distributed import Network

WIDTH = 3  # outputs and states of a DGU: V [V], I_t [A], v [V s]
INPUTS = 2  # inputs of a DGU: I_L [A], V_ref + alpha [V]


class Presence(NamedTuple):
    """A member is there from this step on, or is not."""

    step: int
    member: int
    there: bool


class Lie(NamedTuple):
    """From `start` to before `stop` a member adds a bias to what it tells of every DGU.

    Attributes:
        member: number of the liar.
        start: first step.
        stop: first step without, None: to the end.
        bias: V [V], I_t [A], v [V s].
    """

    member: int
    start: int
    stop: int | None
    bias: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class TeamPlan:
    """The team; members are the DGUs that host its monitors.

    Attributes:
        members: DGU numbers, ascending; the grid's states are those of the members in this order.
        heard: for each member the DGUs whose output it measures, ascending, itself included.
        links: pairs of members that exchange estimates.
        announced: whether I_L and V_ref + alpha of the DGUs that a member does not hear are announced to it.
        structure: "leader" as in D, or "mutual".
        leader: number of the leading member, None: the first that may lead.
        chi: coupling, None: the best of a search.
        sampling_period_sec: T_s [s].
        detector: options of the fixed detector on disagreements.
        isolate: an accused member is left out of the sums.
        presence: who comes and goes, in order of step.
        lies: who lies.
    """

    members: tuple[int, ...]
    heard: Mapping[int, tuple[int, ...]]
    links: tuple[tuple[int, int], ...]
    announced: tuple[bool, bool]
    structure: str
    leader: int | None
    chi: float | None
    sampling_period_sec: float
    detector: Mapping[str, object]
    isolate: bool = True
    presence: tuple[Presence, ...] = ()
    lies: tuple[Lie, ...] = field(default=())

    @property
    def network(self) -> Network:
        """The graph of D, nodes numbered from 0 in the order of the members."""
        number = {member: node for node, member in enumerate(self.members)}
        return linked(len(self.members), [(number[one], number[two]) for one, two in self.links])

    def neighbours(self, member: int) -> tuple[int, ...]:
        """Members whose estimates a member hears, ascending."""
        return tuple(self.members[node] for node in self.network.neighbours(self.members.index(member)))

    def unheard(self, member: int) -> tuple[int, ...]:
        """DGUs that a member does not hear, ascending: their inputs are announced to it."""
        return tuple(dgu for dgu in self.members if dgu not in self.heard[member])

    def known_inputs(self, member: int) -> list[int]:
        """Columns of the grid's inputs (I_L, V_ref + alpha of each DGU) that are announced to a member."""
        return [
            INPUTS * self.members.index(dgu) + which
            for dgu in self.unheard(member)
            for which, told in enumerate(self.announced)
            if told
        ]

    def told(self, announced: Sequence[Sequence[float]]) -> list[float]:
        """Of the inputs (I_L, V_ref + alpha) of several DGUs those that are announced, one after the other."""
        return [value for inputs in announced for value, said in zip(inputs, self.announced, strict=True) if said]

    def measured(self, member: int) -> list[int]:
        """Columns of the grid's outputs that can reach a member."""
        return [WIDTH * self.members.index(dgu) + which for dgu in self.heard[member] for which in range(WIDTH)]

    def there(self, member: int, step: int) -> bool:
        """Whether a member takes part at a step."""
        return there([one for one in self.presence if one.member == member], step)

    def changes(self) -> tuple[int, ...]:
        """Steps from which on the set of members that are there is another one, 0 first."""
        return tuple(sorted({0, *(one.step for one in self.presence)}))


def there(presence: Sequence[Presence], step: int) -> bool:
    """Whether the member of these events takes part at a step: the last event so far says so."""
    past = [one for one in presence if one.step <= step]
    if past:
        return past[-1].there
    return not (presence and presence[0].there)
