"""What a run, a simulation and a replay print in the end: what a person sees is what is recorded."""

from __future__ import annotations

import json as json_module
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from pathlib import Path

    from bags.mcap.recording import Recording
    from bags.reporting.report import RunSummary
    from bags.reporting.team_outline import TeamOutline
    from bags.runs.run_record import RunRecord
    from dgu_sim.scenario import Scenario

_PLOTS = "plots"

# Progress and messages go to standard error, so that standard output carries the result alone.
messages = Console(stderr=True)


def show(bag: Path, plots_dir: Path | None, *, json: bool, partial: bool) -> None:
    """Read the bag back and show what it says: what a person sees is what is recorded."""
    from bags.reporting.outline import outline  # noqa: PLC0415 (heavy)
    from bags.reporting.report import summary  # noqa: PLC0415
    from bags.runs.reader import open_run  # noqa: PLC0415

    if partial:
        _show_counts(bag, json=json)
        return
    run = open_run(bag)
    found = outline(shown(run.windows(), run.steps, "reading"), run.steps)
    pictures: Sequence[Path] = ()
    if plots_dir is not None:
        from bags.reporting.plots import draw  # noqa: PLC0415 (heavy)

        with messages.status("drawing"):
            pictures = draw(found, plots_dir / _PLOTS)
    print_summary(summary(found, bag), pictures, json=json)


def is_partial(scenario: Scenario, recording: Recording) -> bool:
    """Whether topics are left out that a report needs."""
    from bags.wire.schema import run_topics  # noqa: PLC0415 (heavy)

    team = scenario.monitor.team is not None
    topics = run_topics(scenario.grid.dgus, scenario.links, scenario.sampling_period_ns, team=team)
    return not all(recording.topics.accepts(topic.name) for topic in topics.per_step)


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


def shown(windows: Iterable[RunRecord], steps: int, what: str) -> Iterator[RunRecord]:
    """Pass the windows of a run on, with a progress bar for as long as they last."""
    with Progress(console=messages, transient=True) as progress:
        task = progress.add_task(what, total=steps)
        for window in windows:
            yield window
            progress.update(task, completed=window.end_step)


def print_summary(result: RunSummary, pictures: Sequence[Path], *, json: bool) -> None:
    """Print what a run says, as a table or as one JSON document."""
    if json:
        print(json_module.dumps({**result.document(), "plots": [str(path) for path in pictures]}))  # noqa: T201
        return
    console = Console()
    console.print(_table(result))
    if result.team is not None:
        console.print(_team_table(result.team))
    console.print(f"bag:   {result.bag}", highlight=False, soft_wrap=True)
    for path in pictures:
        console.print(f"plot:  {path}", highlight=False, soft_wrap=True)


def _team_table(team: TeamOutline) -> Table:
    table = Table(title=f"team: {team.verdict}", title_justify="left")
    for heading in ("member", "there for [s]", "last error V", "I_t", "v", "accused by", "from [s]"):
        table.add_column(heading, justify="right")
    for one in team.members:
        errors = ("", "", "") if one.last_error is None else (f"{value:.1e}" for value in one.last_error)
        table.add_row(
            str(one.member),
            f"{one.present_sec:.2f}",
            *errors,
            ", ".join(map(str, one.accused_by)),
            "" if one.first_accused_sec is None else f"{one.first_accused_sec:.2f}",
            style="bold red" if one.accused_by else None,
        )
    return table


def _table(result: RunSummary) -> Table:
    seed = "" if result.seed is None else f", seed {result.seed}"
    table = Table(title=f"{result.scenario or result.bag.name}: {result.steps} steps{seed}", title_justify="left")
    for heading in ("link", "attack", "alarm [s]", "delay [s]", "false alarms", "max |r| before", "max |r| after"):
        table.add_column(heading, justify="left" if heading in {"link", "attack"} else "right")
    for link in result.links:
        attack = "" if link.attack_start_sec is None else f"from {link.attack_start_sec:g} s"
        missed = "missed" if link.attacked else ""
        table.add_row(
            f"{_number(link.source)} → {_number(link.target)}",
            attack,
            missed if link.alarm_sec is None else f"{link.alarm_sec:.2f}",
            "" if link.detection_delay_sec is None else f"{link.detection_delay_sec:.2f}",
            str(link.false_alarms),
            f"{link.max_abs_residual_before:.2e}",
            "" if link.max_abs_residual_after is None else f"{link.max_abs_residual_after:.2e}",
            style="bold red" if link.attacked else None,
        )
    return table


def _number(name: str) -> str:
    return name.removeprefix("dgu_")
