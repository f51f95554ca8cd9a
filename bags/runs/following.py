"""A scenario's run block by block: what happened, and what the monitors made of it."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, TypeAlias, final

from bags.runs.ahead import ahead
from bags.watch.combined import Watch, design_combined, design_messages
from bags.watch.combined_arrays import CombinedFields
from bags.watch.monitors import MonitorArrays, design_monitors
from bags.wire.convert import design_record
from bags.wire.documents import DesignCodec
from bags.wire.records import DesignRecord
from bags.wire.schema import RunTopics
from dgu_sim.linear import FloatArray
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import Block, simulate
from monitor.history import History

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


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Following:
    """A run that is ready to go.

    Attributes:
        designs: What the monitors say before step 0, in canonical order.
        blocks: The run; to be gone through once.
    """

    designs: tuple[tuple[DesignCodec, DesignRecord], ...]
    blocks: Iterator[Followed]


def follow(
    scenario: Scenario,
    topics: RunTopics,
    histories: Mapping[int, History],
    recorded: Recorded,
    block_steps: int,
) -> Following:
    """Design the monitors of a scenario and let it run.

    Args:
        scenario: What to run.
        topics: Its topics.
        histories: History of each DGU.
        recorded: As for `dgu_sim.simulate.relay_of`.
        block_steps: Steps in a block.

    Raises:
        monitor.errors.MonitorError: Unknown kind or option.
    """
    run = partial(simulate, scenario, block_steps=block_steps, recorded=recorded)
    if topics.combined is not None:
        return _combined(scenario, topics, histories, run)
    monitors = design_monitors(topics, scenario.monitor, histories)

    def blocks() -> Iterator[Followed]:
        states = monitors.init()
        for block in ahead(run):
            states, outputs = monitors.run(states, block.received[:, 0], block.delivered[:, 0])
            yield Followed(block, outputs, None)

    designs = tuple(
        (topics.design(link), design_record(one, link.source, link.target))
        for link, one in zip(topics.links, monitors.designs, strict=True)
    )
    return Following(designs=designs, blocks=blocks())


def _combined(
    scenario: Scenario, topics: RunTopics, histories: Mapping[int, History], run: Callable[..., Iterator[Block]]
) -> Following:
    """Monitors that draw one conclusion; where they act on it, simulation and monitors go step by step together."""
    designs = design_combined(topics, scenario.monitor, histories)
    watch = Watch(topics=topics, designs=designs)

    def blocks() -> Iterator[Followed]:
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

    return Following(designs=design_messages(topics, designs), blocks=blocks())
