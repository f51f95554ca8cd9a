"""What a run says, as the tables or the JSON document that `dcmg run`, `simulate` and `replay` print."""

from __future__ import annotations

import json as json_module
import math
from typing import TYPE_CHECKING

from rich.console import Console

from bags.reporting.documents import run_document
from bags.reporting.judged import judge
from bags.reporting.timeline import gather
from dcmg.progress import shown
from dcmg.strangers import strangers_document, strangers_table
from dcmg.tabular import tabulate

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from rich.table import Table

    from bags.reporting.judged import AttackRow, Judged, LinkRow
    from bags.reporting.team import TeamSummary
    from bags.reporting.timeline import Timeline
    from bags.runs.run_record import RunRecord
    from dcmg.strangers import StrangeTopic


def show_run(
    windows: Iterable[RunRecord],
    steps: int,
    bag: Path,
    *,
    what: str,
    pictures: Path | None,
    json: bool,
    strangers: Sequence[StrangeTopic] | None = None,
) -> None:
    """Go through a run once, draw it, and print what it says.

    Args:
        windows: Its consecutive windows; at least one.
        steps: Its complete steps.
        bag: What to give as the bag's path.
        what: What is being done, for the progress bar.
        pictures: Folder of the PNG files, None: none.
        json: Print one JSON document instead of tables.
        strangers: What others said on the topics of the run, None: nobody could.
    """
    timeline = gather(shown(windows, steps, what), steps)
    judged = judge(timeline)
    drawn: Sequence[Path] = ()
    if pictures is not None:
        from bags.reporting.pictures import draw  # noqa: PLC0415 (heavy)

        with Console(stderr=True).status("drawing"):
            drawn = draw(timeline, judged, pictures)
    document = run_document(timeline, judged, bag)
    if json:
        told = {} if strangers is None else {"strangers": strangers_document(strangers)}
        print(json_module.dumps({**document, **told, "plots": [str(path) for path in drawn]}))  # noqa: T201
        return
    console = Console()
    seed = "" if document["seed"] is None else f", seed {document['seed']}"
    console.print(
        f"{document['scenario'] or bag.name}: {steps} steps{seed}", highlight=False, markup=False, soft_wrap=True
    )
    for table in tables(timeline, judged):
        console.print(table)
    if strangers:
        console.print(strangers_table(strangers))
    console.print(f"bag:   {bag}", highlight=False, markup=False, soft_wrap=True)
    for path in drawn:
        console.print(f"plot:  {path}", highlight=False, markup=False, soft_wrap=True)


def tables(timeline: Timeline, judged: Judged) -> list[Table]:
    """Attacks, links, what was commanded if anything was, and the team where there is one."""
    found = [_attacks(judged.attacks, timeline)] if judged.attacks else []
    found.append(_links(judged.links, timeline))
    found += [_commands(timeline)] if timeline.run.commands else []
    return found if timeline.team is None else [*found, _team(timeline.team)]


def attack_words(row: AttackRow, duration_sec: float) -> tuple[str, ...]:
    """The row of an attack: kind, links, from, to, seen, accused."""
    links = ", ".join(str(link) for link in row.attack.links)
    start = f"{row.episode.start_sec:g}"
    if not row.attack.began:
        return (row.attack.kind, links, start, "", "never began", f"the run ended at {duration_sec:g} s")
    delay = row.episode.delay_sec
    stop = "end" if row.stop_sec is None else f"{row.stop_sec:g}"
    accused = ", ".join(str(link) for link in row.accused) or "nobody"
    if row.calibrating:
        accused += " (the detectors still learned when it began)"
    if row.wrongly_accused:
        accused += f"; wrongly {', '.join(str(link) for link in row.wrongly_accused)}"
    others = [f"{name} {late:.2f}" for name, late in row.delays_sec.items() if late is not None]
    if delay is None and others:
        accused += f" (but: {', '.join(others)})"
    return (row.attack.kind, links, start, stop, "missed" if delay is None else f"after {delay:.2f} s", accused)


def attack_line(row: AttackRow, duration_sec: float) -> str:
    """The row of an attack as a sentence."""
    kind, links, start, stop, seen, accused = attack_words(row, duration_sec)
    if not row.attack.began:
        return f"{kind} on {links} from {start} s: {seen}, {accused}"
    return (
        f"{kind} on {links} from {start} s to {'the end' if stop == 'end' else f'{stop} s'}: {seen}, accused: {accused}"
    )


def _attacks(rows: Sequence[AttackRow], timeline: Timeline) -> Table:
    headings = ("attack", "on link", "from [s]", "to [s]", "seen", "accused")
    styles = [None if row.episode.detected else "bold red" if row.attack.began else "yellow" for row in rows]
    return tabulate(headings, [attack_words(row, timeline.duration_sec) for row in rows], styles=styles)


def _links(rows: Sequence[LinkRow], timeline: Timeline) -> Table:
    headings = ("link", "attacks seen", "false alarms" if timeline.labelled else "alarms", "|r|/threshold", "attacked")
    cells = [
        (
            f"{row.link.source} → {row.link.target}",
            f"{row.seen} of {len(row.episodes)}" if row.episodes else "",
            str(row.alarms) if row.monitored else "not monitored",
            _number(row.quiet_score),
            _number(row.attacked_score),
        )
        for row in rows
    ]
    styles = ["bold red" if row.episodes else None for row in rows]
    return tabulate(headings, cells, numbers=set(headings[1:]), styles=styles)


def _commands(timeline: Timeline) -> Table:
    rows = [(f"{one.step * timeline.period_sec:g}", one.command.words) for one in timeline.run.commands]
    return tabulate(("from [s]", "command"), rows, numbers={"from [s]"})


def _team(team: TeamSummary) -> Table:
    headings = ("member", "there for [s]", "last error V", "I_t", "v", "accused by", "from [s]")
    rows = [
        (
            str(one.member),
            f"{one.present_sec:.2f}",
            *(("", "", "") if one.last_error is None else (f"{value:.1e}" for value in one.last_error)),
            ", ".join(map(str, one.accused_by)),
            "" if one.first_accused_sec is None else f"{one.first_accused_sec:.2f}",
        )
        for one in team.members
    ]
    styles = ["bold red" if one.accused_by else None for one in team.members]
    return tabulate(headings, rows, numbers=set(headings), styles=styles, title=f"team: {team.verdict}")


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.2g}"
