"""A scenario's run block by block: what happened, and what the monitors made of it."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from bags.runs.ahead import ahead
from bags.watch.combined import Watch
from bags.watch.combined_arrays import CombinedFields
from bags.watch.designs import RunDesigns
from bags.watch.monitors import MonitorArrays
from dgu_sim.linear import FloatArray
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import Block, simulate

Recorded: TypeAlias = Mapping[int, Sequence[FloatArray]] | None


class Followed(NamedTuple):
    """Consecutive steps of one run.

    Attributes:
        block: What happened.
        links: What the monitors of the links concluded.
        combined: What else the monitors said; None unless they draw one conclusion from several tests.
    """

    block: Block
    links: MonitorArrays
    combined: CombinedFields | None


def follow(scenario: Scenario, designs: RunDesigns, recorded: Recorded, block_steps: int) -> Iterator[Followed]:
    """Let a scenario run under the eyes of its monitors.

    Args:
        scenario: What to run.
        designs: What its monitors run.
        recorded: As for `dgu_sim.simulate.relay_of`.
        block_steps: Steps in a block.

    Raises:
        monitor.errors.MonitorError: Unknown kind or option.
    """
    run = partial(simulate, scenario, block_steps=block_steps, recorded=recorded)
    watch = Watch(designs=designs)
    if designs.settings.response is not None:  # simulation and monitors go step by step together
        for block in run(respond=watch):
            yield Followed(block, *watch.take())
        return
    for block in ahead(run):
        spoofed: dict[int, list[int]] = {}
        for one in block.doubled:
            spoofed.setdefault(one.step - block.first_step, []).append(one.position)
        alone = _Run(block.y[:, 0], block.reference[:, 0], block.received[:, 0], block.delivered[:, 0])
        yield Followed(block, *watch.follow(alone, spoofed))


class _Run(NamedTuple):
    """The one run of a block, as a `Seen`."""

    y: FloatArray
    reference: FloatArray
    received: FloatArray
    delivered: NDArray[np.bool_]
    u: FloatArray | None = None
