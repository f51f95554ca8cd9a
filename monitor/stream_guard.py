"""Whether the messages on one incoming link are a stream: one of each step, in order, of one source and publisher.

It looks at what the messages say about themselves and at who sent them, never at what they measure. So it sees what no
residual can, and nothing of a falsification that goes along with the stream: an attacker in the place of the link
sends one message of each step, with the right number, whatever it makes of the content.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence


class StreamFault(StrEnum):
    """What can be wrong with a stream, in the order in which it is told."""

    SECOND_PUBLISHER = "second_publisher"
    WRONG_SOURCE = "wrong_source"
    MISSING = "missing"
    REPEATED = "repeated"
    OUT_OF_ORDER = "out_of_order"


class Arrival(NamedTuple):
    """One message, without what it measures.

    Attributes:
        step: the step it claims to be of.
        source: the DGU that it claims to come from.
        delivered: whether it holds a sample: a link that loses one says so.
        known: whether it comes from the publisher that is known since step 0.
    """

    step: int
    source: int
    delivered: bool = True
    known: bool = True


class StreamChange(NamedTuple):
    """A fault appears or is over.

    Attributes:
        kind: the fault.
        active: True: it is there from this step on; False: this step is free of it.
        detail: in words.
    """

    kind: StreamFault
    active: bool
    detail: str


Faults = tuple[StreamFault, ...]
"""State of a guard: the faults of the last step, ascending."""


@dataclass(frozen=True, slots=True)
class StreamGuard:
    """Guard of the messages that claim to come from one DGU.

    Its promise: no alarm on a link that loses nothing, has one publisher and is left alone. It needs no calibration.

    Attributes:
        source: the DGU.
    """

    source: int

    def init(self) -> Faults:
        """State before step 0: no fault."""
        return ()

    def step(self, state: Faults, k: int, arrivals: Sequence[Arrival]) -> tuple[Faults, tuple[StreamChange, ...]]:
        """Take what arrived for step k, in the order of arrival."""
        found = self._faults(k, arrivals)
        changes = [
            StreamChange(kind, kind in found, found.get(kind, "in order again"))
            for kind in StreamFault
            if (kind in found) != (kind in state)
        ]
        return tuple(kind for kind in StreamFault if kind in found), tuple(changes)

    def _faults(self, k: int, arrivals: Sequence[Arrival]) -> dict[StreamFault, str]:
        found: dict[StreamFault, str] = {}
        others = [one for one in arrivals if not one.known]
        known = [one for one in arrivals if one.known]
        if others:
            claimed = ", ".join(f"step {one.step} of dgu_{one.source}" for one in others)
            found[StreamFault.SECOND_PUBLISHER] = f"a publisher unknown at step 0 sent {claimed}"
        wrong = [one.source for one in known if one.source != self.source]
        if wrong:
            found[StreamFault.WRONG_SOURCE] = f"dgu_{wrong[0]} is named as the source, expected dgu_{self.source}"
        steps = [one.step for one in known]
        if k not in steps:
            found[StreamFault.MISSING] = f"no message of step {k}"
        elif not any(one.delivered for one in known if one.step == k):
            found[StreamFault.MISSING] = f"the link lost the sample of step {k}"
        if steps.count(k) > 1 or k - 1 in steps:
            twice = k if steps.count(k) > 1 else k - 1
            found[StreamFault.REPEATED] = f"step {twice} came again"
        astray = [step for step in steps if step not in (k - 1, k)]
        if astray:
            found[StreamFault.OUT_OF_ORDER] = f"step {astray[0]} came, expected step {k}"
        return found
