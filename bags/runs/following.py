"""A scenario's run block by block: what happened, and what the monitors made of it."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from bags.runs.ahead import ahead
from bags.watch.combined_arrays import CombinedFields
from bags.watch.designs import RunDesigns
from bags.watch.histories import recorded_states
from bags.watch.monitors import MonitorArrays, link_monitors
from bags.watch.watcher import Watcher
from dgu_sim.errors import ScenarioError
from dgu_sim.linear import FloatArray
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import BLOCK_STEPS, Block, simulate

if TYPE_CHECKING:
    from dgu_sim.commands import Command

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
    watch = Watcher(designs=designs)
    if designs.settings.response is not None:  # simulation and monitors go step by step together
        for block in run(respond=watch):
            yield Followed(block, *watch.take())
        return
    for block in ahead(run):
        yield watched(watch, block)


def watched(watch: Watcher, block: Block) -> Followed:
    """What the monitors of one run make of steps that are over.

    Args:
        watch: The monitors; they take these steps next.
        block: What happened.
    """
    spoofed: dict[int, list[int]] = {}
    for one in block.doubled:
        spoofed.setdefault(one.step - block.first_step, []).append(one.position)
    given: dict[int, list[Command]] = {}
    for told in block.commands:
        given.setdefault(told.step - block.first_step, []).append(told.command)
    alone = _Run(block.y[:, 0], block.reference[:, 0], block.received[:, 0], block.delivered[:, 0])
    return Followed(block, *watch.follow(alone, spoofed, given))


def follow_many(scenario: Scenario, seeds: Sequence[int], block_steps: int = BLOCK_STEPS) -> Iterator[Followed]:
    """Let one run for each seed go on under the eyes of a monitor on each link, which alone is what is watched here.

    The monitors of all runs learn from the histories of the scenario's own seed: the seeds are held out.

    Args:
        scenario: What to run.
        seeds: Seeds of the runs; conclusions have the shape (steps, runs, links, ...).
        block_steps: Steps in a block.

    Raises:
        BagError: A history cannot be read.
        monitor.errors.MonitorError: Unknown observer or detector, or options of theirs.
        ScenarioError: The scenario has a script, whose commands these monitors would not obey.
    """
    if scenario.script:
        raise ScenarioError(
            f"{scenario.name}: script: {len(scenario.script)} commands, expected none in many runs at once"
        )
    monitors = link_monitors(scenario, len(seeds))
    states = monitors.init()
    for block in simulate(scenario, seeds, block_steps, recorded_states(scenario)):
        states, links = monitors.run(states, block.received, block.delivered)
        yield Followed(block, links, None)


class _Run(NamedTuple):
    """The one run of a block, as a `Seen`."""

    y: FloatArray
    reference: FloatArray
    received: FloatArray
    delivered: NDArray[np.bool_]
    u: FloatArray | None = None
