"""Many runs of a scenario watched at once, without a bag: what statistics on false alarms and detection need."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from bags.mcap.errors import BagError
from bags.watch.histories import histories_of_run, recorded_states
from bags.watch.monitors import LinkGroup, RunMonitors, design_monitors
from bags.watch.stacked_observer import StackedObserver
from bags.wire.convert import history_of
from bags.wire.schema import run_topics
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import Block, simulate
from monitor import detectors


@final
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
        BagError: A history cannot be read, or an observer is not linear.
        monitor.errors.MonitorError: Unknown observer or detector, or options of theirs.
    """
    topics = run_topics(scenario.grid.dgus, scenario.links, scenario.sampling_period_ns)
    histories = {dgu: history_of(histories_of_run(scenario, dgu)) for dgu in topics.dgus}
    detector = detectors.build(
        scenario.monitor.detector.kind, scenario.monitor.detector.options, scenario.sampling_period_sec
    )
    monitors = _repeated(design_monitors(topics, scenario.monitor, histories), detector, len(seeds))
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


def _repeated(monitors: RunMonitors, detector: detectors.Detector[object], runs: int) -> RunMonitors:
    """The monitors of one run side by side for several, run after run on the axis "links"."""
    links = len(monitors.designs)
    groups = []
    for group in monitors.groups:
        observer = group.monitor.observer
        if not isinstance(observer, StackedObserver):
            raise BagError(f"observer {monitors.designs[int(group.positions[0])].kind}: expected a linear one")
        whole, start = (np.tile(one, (1, 1, runs)) for one in (observer.whole, observer.start))
        many = replace(group.monitor, observer=replace(observer, whole=whole, start=start), detector=detector)
        positions = np.concatenate([run * links + group.positions for run in range(runs)])
        groups.append(LinkGroup(positions=positions, monitor=many))
    return RunMonitors(designs=monitors.designs * runs, groups=tuple(groups))
