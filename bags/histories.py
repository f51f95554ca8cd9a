"""Offline experiments as a bag of their own."""

from collections.abc import Sequence
from pathlib import Path

from bags.convert import history_records
from bags.origin import attach_origin
from bags.schema import run_topics
from bags.writer import BagWriter
from dgu_sim.experiment import run_experiments
from dgu_sim.scenario import Scenario


def write_histories(scenario: Scenario, dgus: Sequence[int], path: Path) -> Path:
    """Run the offline experiments of some DGUs and record them on the topics of a run.

    Args:
        scenario: Its `history` section says how; the seed is its own.
        dgus: Numbers of the DGUs.
        path: The bag's directory; must not exist.

    Returns:
        The path.

    Raises:
        BagError: The bag cannot be written.
        dgu_sim.errors.ScenarioError: The scenario has no such DGU.
    """
    topics = run_topics(scenario.grid.dgus, scenario.links, scenario.sampling_period_ns)
    codecs = [topics.history(dgu) for dgu in dgus]
    with BagWriter(path, [codec.topic for codec in codecs]) as writer:
        attach_origin(writer, scenario)
        for codec in codecs:
            for record in history_records(codec.dgu, run_experiments(scenario, codec.dgu)):
                writer.write(codec.topic.name, 0, codec.encode(record))
    return path
