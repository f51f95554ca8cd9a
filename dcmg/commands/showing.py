"""What a run, a simulation and a replay print in the end: what a person sees is what is recorded."""

from __future__ import annotations

import json as json_module
from typing import TYPE_CHECKING

from rich.console import Console

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from bags.mcap.recording import Recording
    from dcmg.strangers import StrangeTopic
    from dgu_sim.scenario import Scenario

_PLOTS = "plots"

# Progress and messages go to standard error, so that standard output carries the result alone.
messages = Console(stderr=True)


def show(
    bag: Path,
    plots_dir: Path | None,
    *,
    json: bool,
    partial: bool,
    strangers: Sequence[StrangeTopic] | None = None,
) -> None:
    """Read the bag back and show what it says: what a person sees is what is recorded.

    Args:
        bag: The bag.
        plots_dir: Where pictures go, None: none.
        json: Print one JSON document instead of tables.
        partial: Whether the bag holds too little for a report.
        strangers: What others said on the topics of a run over ROS; None where there was no ROS.
    """
    from bags.runs.reader import open_run  # noqa: PLC0415 (heavy)
    from dcmg.run_tables import show_run  # noqa: PLC0415

    if partial:
        _show_counts(bag, json=json)
        return
    run = open_run(bag)
    pictures = None if plots_dir is None else plots_dir / _PLOTS
    show_run(run.windows(), run.steps, bag, what="reading", pictures=pictures, json=json, strangers=strangers)


def is_partial(scenario: Scenario, recording: Recording) -> bool:
    """Whether topics are left out that a report needs."""
    from bags.wire.schema import topics_of  # noqa: PLC0415 (heavy)

    return not all(recording.topics.accepts(topic.name) for topic in topics_of(scenario).per_step)


def _show_counts(bag: Path, *, json: bool) -> None:
    """Say what is in a bag that was told to hold only some topics: too little for a report."""
    from bags.mcap.bag import open_bag  # noqa: PLC0415 (heavy)

    counts = {topic.name: topic.count for topic in open_bag(bag).topics.values()}
    if json:
        print(json_module.dumps({"bag": str(bag), "topics": counts}))  # noqa: T201
        return
    console = Console()
    console.print(f"{sum(counts.values())} messages on {len(counts)} of the run's topics: no report", highlight=False)
    console.print(f"bag:   {bag}", highlight=False, soft_wrap=True)
