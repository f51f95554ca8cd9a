"""A scenario's run block by block: what happened, and what the monitors made of it."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple, TypeAlias

from bags.runs.ahead import ahead
from bags.watch.combined import Watch
from bags.watch.combined_arrays import CombinedFields
from bags.watch.designs import RunDesigns
from bags.watch.monitors import MonitorArrays, monitors_of
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
    return _links(designs, run) if designs.topics.combined is None else _combined(scenario, designs, run)


def _links(designs: RunDesigns, run: Callable[..., Iterator[Block]]) -> Iterator[Followed]:
    """Monitors that look at one link each."""
    monitors = monitors_of(designs)
    states = monitors.init()
    for block in ahead(run):
        states, outputs = monitors.run(states, block.received[:, 0], block.delivered[:, 0])
        yield Followed(block, outputs, None)


def _combined(scenario: Scenario, designs: RunDesigns, run: Callable[..., Iterator[Block]]) -> Iterator[Followed]:
    """Monitors that draw one conclusion; where they act on it, simulation and monitors go step by step together."""
    watch = Watch(designs=designs)
    if scenario.monitor.response is not None:
        for block in run(respond=watch):
            yield Followed(block, *watch.take())
        return
    for block in ahead(run):
        spoofed: dict[int, list[int]] = {}
        for one in block.doubled:
            spoofed.setdefault(one.step - block.first_step, []).append(one.position)
        watch.follow(block.y[:, 0], block.reference[:, 0], block.received[:, 0], block.delivered[:, 0], spoofed)
        yield Followed(block, *watch.take())
