"""Many runs of a scenario watched at once, without a bag: what statistics on false alarms and detection need."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bags.watch.histories import recorded_states
from bags.watch.monitors import link_monitors
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import Block, simulate


@dataclass(frozen=True, slots=True, kw_only=True)
class Watched:
    """Consecutive steps of all runs, and what the monitors concluded.

    Attributes:
        block: The steps.
        phase: Phases of the monitors, shape (steps, runs, links).
        alarm: Verdicts, shape (steps, runs, links).
        residual: Shape (steps, runs, links, 3) [V, A, V s].
        threshold: Likewise.
    """

    block: Block
    phase: NDArray[np.uint8]
    alarm: NDArray[np.bool_]
    residual: NDArray[np.float64]
    threshold: NDArray[np.float64]


def watch(scenario: Scenario, seeds: Sequence[int], block_steps: int = 1000) -> Iterator[Watched]:
    """Simulate one run for each seed and watch every link of each.

    The monitors of all runs learn from the histories of the scenario's own seed: the seeds are held out.

    Args:
        scenario: What to run.
        seeds: Seeds of the runs.
        block_steps: Steps in a block.

    Raises:
        BagError: A history cannot be read.
        monitor.errors.MonitorError: Unknown observer or detector, or options of theirs.
    """
    monitors = link_monitors(scenario, len(seeds))
    states = monitors.init()
    for block in simulate(scenario, seeds, block_steps, recorded_states(scenario)):
        shape = block.delivered.shape
        received = block.received.reshape(shape[0], -1, block.received.shape[-1])
        states, outputs = monitors.run(states, received, block.delivered.reshape(shape[0], -1))
        yield Watched(
            block=block,
            phase=outputs.phase.reshape(shape),
            alarm=outputs.alarm.reshape(shape),
            residual=outputs.residual.reshape(*shape, -1),
            threshold=outputs.threshold.reshape(*shape, -1),
        )
