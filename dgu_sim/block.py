"""What the time loop yields: consecutive steps of all runs in arrays, and the rows of one block while it fills."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dgu_sim.linear import FloatArray
from dgu_sim.relay import RelayEvent
from dgu_sim.script import CommandEvent

__all__ = ["Block", "Doubled", "Rows", "RunEvent"]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunEvent:
    """An attack event of one run; `run` is its index on the runs axis."""

    run: int
    event: RelayEvent


@dataclass(frozen=True, slots=True, kw_only=True)
class Doubled:
    """Two messages of one step on one link: what the link delivered, and what a second publisher sent.

    Attributes:
        step: The step.
        position: The link, by its place among the links.
        relayed: y of the first message, shape (runs, 3).
        relayed_delivered: False where the link lost it, shape (runs,).
        spoofed: y of the second message, shape (runs, 3).
        spoofed_delivered: Shape (runs,).
    """

    step: int
    position: int
    relayed: FloatArray
    relayed_delivered: NDArray[np.bool_]
    spoofed: FloatArray
    spoofed_delivered: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """Consecutive steps of all runs.

    Attributes:
        first_step: Step of the first row.
        x: True states, shape (steps, runs, DGUs, 3): V [V], I_t [A], v [V s].
        y: Sent outputs, same shape and units.
        load_current: I_L held over each step, shape (steps, runs, DGUs) [A].
        reference: V_ref + alpha held over each step, same shape [V].
        alpha: Secondary correction, same shape [V].
        received: Received outputs as the receivers take them, shape (steps, runs, links, 3).
        delivered: False where a link lost the sample, shape (steps, runs, links).
        events: Attack events of these steps, in order of step.
        doubled: Where a second publisher spoke, in order of step and link.
        commands: What was commanded at these steps, in order.
    """

    first_step: int
    x: FloatArray
    y: FloatArray
    load_current: FloatArray
    reference: FloatArray
    alpha: FloatArray
    received: FloatArray
    delivered: NDArray[np.bool_]
    events: tuple[RunEvent, ...]
    doubled: tuple[Doubled, ...] = ()
    commands: tuple[CommandEvent, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """Rows of one block while it fills, component before run so that a step's components are contiguous.

    Attributes:
        truth: V, I_t, v, I_L, V_ref + alpha, alpha; shape (steps, 6, runs, DGUs).
        sent: y, shape (steps, 3, runs, DGUs).
        received: y^c, shape (steps, 3, runs, links).
        delivered: Shape (steps, runs, links).
    """

    truth: FloatArray
    sent: FloatArray
    received: FloatArray
    delivered: NDArray[np.bool_]

    @classmethod
    def empty(cls, steps: int, runs: int, dgus: int, links: int) -> "Rows":
        """Return rows for so many steps; every sample is delivered until somebody says otherwise."""
        return cls(
            truth=np.empty((steps, 6, runs, dgus)),
            sent=np.empty((steps, 3, runs, dgus)),
            received=np.empty((steps, 3, runs, links)),
            delivered=np.ones((steps, runs, links), dtype=np.bool_),
        )

    def block(
        self,
        first_step: int,
        events: tuple[RunEvent, ...],
        doubled: tuple[Doubled, ...],
        commands: tuple[CommandEvent, ...],
    ) -> Block:
        """Return the block that the rows are."""

        def component_last(array: FloatArray) -> FloatArray:
            return np.ascontiguousarray(np.moveaxis(array, 1, -1))

        return Block(
            first_step=first_step,
            x=component_last(self.truth[:, :3]),
            y=component_last(self.sent),
            load_current=np.ascontiguousarray(self.truth[:, 3]),
            reference=np.ascontiguousarray(self.truth[:, 4]),
            alpha=np.ascontiguousarray(self.truth[:, 5]),
            received=component_last(self.received),
            delivered=self.delivered,
            events=events,
            doubled=doubled,
            commands=commands,
        )
