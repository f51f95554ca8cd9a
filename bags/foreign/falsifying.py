"""Attacks on recorded data: a relay stands on the links of an import, as it stands on those of a run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import nan

import numpy as np

from bags.wire.records import HistoryRecord
from dgu_sim.errors import AttackError
from dgu_sim.grid import Link
from dgu_sim.linear import FloatArray
from dgu_sim.records import Sample
from dgu_sim.relay import AttackPlan, Relay, RelayEvent

_COMPONENTS = ("V", "I_t", "v")


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedKnowledge:
    """What an attacker on the links of a recording can find out: the histories, and nothing of the grid.

    Attributes:
        histories: States of each recorded experiment, by DGU.
        outputs: Number of outputs that each DGU sends.
    """

    histories: Mapping[int, tuple[FloatArray, ...]]
    outputs: Mapping[int, int]

    def model(self, dgu: int) -> tuple[FloatArray, FloatArray]:
        """Nobody knows A and E of what was recorded.

        Raises:
            AttackError: Always.
        """
        raise _unknown(f"the model of DGU {dgu}")

    def history(self, dgu: int, seed: int) -> Sequence[FloatArray]:
        """States (T, 3) of each recorded experiment, whatever the seed.

        Raises:
            AttackError: The import was given none.
        """
        del seed
        if not self.histories.get(dgu):
            raise AttackError(f"the attack needs a history of DGU {dgu}: expected --history with one")
        return self.histories[dgu]

    def conductance(self, link: Link) -> float:
        """Nobody knows the lines.

        Raises:
            AttackError: Always.
        """
        raise _unknown(f"the resistance of line {link}")

    def keeps(self, dgu: int) -> tuple[str, ...]:
        """Components that one DGU does not send."""
        return _COMPONENTS[self.outputs.get(dgu, len(_COMPONENTS)) :]

    def rated_current(self, dgu: int) -> float:
        """Nobody knows the ratings.

        Raises:
            AttackError: Always.
        """
        raise _unknown(f"the rated current of DGU {dgu}")


class Falsifier:
    """Relays the samples of an import, step by step."""

    def __init__(
        self,
        links: Sequence[Link],
        plans: Sequence[AttackPlan],
        period_sec: float,
        knowledge: RecordedKnowledge,
        seed: int = 0,
    ) -> None:
        """Schedule the attacks.

        Args:
            links: In the order of the samples.
            plans: The attacks; their times count from the first sample.
            period_sec: T_s [s].
            knowledge: What the attacker can find out.
            seed: Of random attacks.

        Raises:
            AttackError: A link is not there, a parameter is wrong, or the attack needs a running grid.
        """
        sources = [link.source for link in links]
        twice = next((one for one in sources if sources.count(one) > 1), None)
        if plans and twice is not None:
            raise AttackError(f"two links come from DGU {twice}: expected one to be falsified, import the other apart")
        for plan in plans:
            if plan.kind == "spoof":
                raise AttackError(
                    "spoof: a second publisher stands on no recording, expected the attack it falsifies by"
                )
        self._relay = Relay(
            dgus=tuple(sources), links=tuple(links), sampling_period_sec=period_sec, seed=seed, insight=knowledge
        )
        self._state = self._relay.init(plans)

    def step(self, samples: Sequence[Sample]) -> tuple[tuple[Sample, ...], tuple[RelayEvent, ...]]:
        """What the links deliver of the samples of one step, and which attacks start or end with it."""
        width = len(_COMPONENTS)
        # attacks are written for V, I_t and v: what is sent besides passes as it is
        heads = [Sample(y=(*one.y, nan, nan, nan)[:width], delivered=one.delivered) for one in samples]
        self._state, received, events = self._relay.step(self._state, heads)
        found = [
            Sample(y=(*new.y[: len(old.y)], *old.y[width:]), delivered=new.delivered, u=old.u)
            for old, new in zip(samples, received, strict=True)
        ]
        return tuple(found), events


def states_of(records: Sequence[HistoryRecord]) -> dict[int, tuple[FloatArray, ...]]:
    """States of each recorded experiment by DGU, as far as they are whole."""
    found: dict[int, tuple[FloatArray, ...]] = {}
    for one in records:
        if np.isfinite(one.x).all():
            found[one.dgu] = (*found.get(one.dgu, ()), np.asarray(one.x))
    return found


def _unknown(what: str) -> AttackError:
    return AttackError(f"the attack needs {what}, which no recording tells: expected one that needs no running grid")
