"""Who hears and feels whom in a grid, as array positions: how one row of all runs is handed around."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dgu_sim.block import Doubled
from dgu_sim.linear import FloatArray
from dgu_sim.plant import physical_of
from dgu_sim.records import Physical, Sample
from dgu_sim.relay import Relay, RelayEvent, RelayState
from dgu_sim.scenario import Scenario
from dgu_sim.settings import Accept

__all__ = ["Wiring"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Wiring:
    """Who hears whom, as array positions.

    Attributes:
        dgus: Number of DGUs.
        sources: Position of the sending DGU of each link.
        physical_slots: Position of the DGU in each slot of each DGU, shape (slots, DGUs).
        link_slots: Position of the link in each slot of each DGU, shape (slots, DGUs).
        wired: False where a DGU has fewer links than slots, shape (1, slots, DGUs).
        accept: Which of two messages the receivers take.
    """

    dgus: int
    sources: NDArray[np.intp]
    physical_slots: NDArray[np.intp]
    link_slots: NDArray[np.intp]
    wired: NDArray[np.bool_]
    accept: Accept

    @classmethod
    def of(cls, scenario: Scenario) -> "Wiring":
        """Return the wiring of a scenario's grid, in the order of its DGUs and links."""
        grid = scenario.grid
        position = {dgu: index for index, dgu in enumerate(grid.dgus)}
        physical = [[position[other] for other in physical_of(grid, scenario.coupling, dgu)] for dgu in grid.dgus]
        incoming: list[list[int]] = [[] for _ in grid.dgus]
        for place, link in enumerate(scenario.links):
            incoming[position[link.target]].append(place)
        return cls(
            dgus=len(grid.dgus),
            sources=np.array([position[link.source] for link in scenario.links], dtype=np.intp),
            # An empty slot has coefficient 0: its own DGU brings nothing into a sum that is not there already.
            physical_slots=_padded(physical, list(range(len(grid.dgus)))),
            link_slots=_padded(incoming, [0] * len(grid.dgus)),
            wired=_padded([[1] * len(own) for own in incoming], [0] * len(grid.dgus))[np.newaxis] > 0,
            accept=scenario.receiver.accept,
        )

    def physical(self, truth: FloatArray) -> list[Physical]:
        """Return what each slot feels, from one row of truth (6, runs, DGUs)."""
        slots = truth.take(self.physical_slots, axis=-1)
        return [
            Physical(x=slots[:3, :, slot], load_current=slots[3, :, slot], reference=slots[4, :, slot])
            for slot in range(len(self.physical_slots))
        ]

    def received(self, received: FloatArray, delivered: NDArray[np.bool_]) -> list[Sample]:
        """Return what each slot receives, from one row (3, runs, links)."""
        y = received.take(self.link_slots, axis=-1)
        arrived = delivered.take(self.link_slots, axis=-1) & self.wired
        return [Sample(y=y[:, :, slot], delivered=arrived[:, slot]) for slot in range(len(self.link_slots))]

    def relay(
        self,
        relay: Relay,
        state: RelayState,
        sent: FloatArray,
        received: FloatArray,
        delivered: NDArray[np.bool_],
    ) -> tuple[RelayState, tuple[RelayEvent, ...]]:
        """Relay one row: copy what passes untouched at once, then write the samples that an attack replaced."""
        sent.take(self.sources, axis=-1, out=received)
        outputs = [Sample(y=sent[:, :, dgu]) for dgu in range(self.dgus)]
        following, samples, events = relay.step(state, outputs)
        for position, (source, sample) in enumerate(zip(relay.sources, samples, strict=True)):
            if sample is not outputs[source]:
                received[0, :, position], received[1, :, position], received[2, :, position] = sample.y
                delivered[:, position] = sample.delivered
        return following, events

    def spoof(
        self, step: int, state: RelayState, received: FloatArray, delivered: NDArray[np.bool_]
    ) -> Iterator[Doubled]:
        """Keep both messages of each spoofed link, and write the one that is taken into its row (3, runs, links)."""
        for position, sample in state.spoofed:
            spoofed = np.stack(np.broadcast_arrays(*sample.y, received[0, :, position])[:-1], axis=-1)
            arrived = np.broadcast_to(sample.delivered, spoofed.shape[:1]).copy()
            relayed = np.array(received[:, :, position].T, order="C")  # a copy: the row may be overwritten below
            yield Doubled(
                step=step,
                position=position,
                relayed=relayed,
                relayed_delivered=delivered[:, position].copy(),
                spoofed=spoofed,
                spoofed_delivered=arrived,
            )
            if self.accept is Accept.NEWEST:
                received[:, :, position] = spoofed.T
                delivered[:, position] = arrived


def _padded(positions: Sequence[Sequence[int]], filler: Sequence[int]) -> NDArray[np.intp]:
    """Return slot by DGU positions, empty slots filled with one position for each DGU."""
    slots = max(len(own) for own in positions)
    rows = [
        [own[slot] if slot < len(own) else fill for own, fill in zip(positions, filler, strict=True)]
        for slot in range(slots)
    ]
    return np.array(rows, dtype=np.intp).reshape(slots, len(positions))
