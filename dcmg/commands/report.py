"""`dcmg report`: what a recorded run says about detection, as a web page and a JSON document."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 (typer reads the annotations)
from typing import TYPE_CHECKING, Annotated

import typer

from dcmg.progress import shown

if TYPE_CHECKING:
    from bags.reporting.write import Report


def report(
    bag: Annotated[Path, typer.Argument(help="bag of a run: recorded, simulated, or repaired", show_default=False)],
    *,
    out: Annotated[
        Path | None,
        typer.Option(
            help="folder for report.html and report.json; default: BAG's name and _report", show_default=False
        ),
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="A.B=VALUE",
            help="judge by other monitors than the recorded ones, as in `monitor.detector={kind: cusum}`; repeatable",
            show_default=False,
        ),
    ] = None,
    level: Annotated[float, typer.Option(min=0.5, max=0.999, help="confidence of the intervals")] = 0.95,
    seed: Annotated[int, typer.Option(min=0, help="seed of the bootstrap")] = 1,
    block: Annotated[
        float, typer.Option(metavar="SECONDS", min=1e-6, help="least time drawn as one piece in the bootstrap")
    ] = 0.5,
    aftermath: Annotated[
        float, typer.Option(metavar="SECONDS", min=0.0, help="time after an attack that counts for nothing")
    ] = 0.5,
    json: Annotated[bool, typer.Option("--json", help="print the JSON document, and nothing else there")] = False,
) -> None:
    """Measure a run: detection, false alarms, ROC, isolation, impact, errors of estimates, with confidence intervals.

    Writes one HTML file with interactive plots, which opens without a network, and one JSON file with every number.
    """
    from bags.reporting.options import ReportOptions  # noqa: PLC0415
    from bags.reporting.write import write_report  # noqa: PLC0415
    from bags.runs.reader import open_run  # noqa: PLC0415 (heavy)
    from bags.runs.replay import concluded  # noqa: PLC0415

    run = open_run(bag)
    windows = concluded(run.windows(), set_ or ())
    options = ReportOptions(level=level, seed=seed, block_sec=block, aftermath_sec=aftermath)
    folder = out or bag.with_name(f"{bag.resolve().name}_report")
    made = write_report(shown(windows, run.steps, "reading"), run.steps, folder, options)
    if json:
        typer.echo(made.json.read_text(encoding="utf-8"))
        return
    for line in _lines(made):
        typer.echo(line)
    if not any(one.row.monitored for one in made.assessment.links):
        typer.echo(
            "no link was watched: the bag holds no design, nor, for a stream from outside, the histories to make one"
        )


def _lines(made: Report) -> list[str]:
    """The run in a few lines, and where the rest is."""
    from bags.reporting.wording import interval, number, share  # noqa: PLC0415 (heavy)
    from dcmg.run_tables import attack_line  # noqa: PLC0415 (idem)

    lines, impacts = [], {one.row.attack.number: one for one in made.assessment.attacks}
    for row in made.assessment.judged.attacks:
        lines.append(attack_line(row, made.timeline.duration_sec))
        one = impacts.get(row.attack.number)
        if one is not None and one.unanswered and one.impact:
            largest, avoided = one.impact["mean_voltage"].largest, one.unanswered["mean_voltage"].largest
            lines.append(f"  largest |<V> - <V_ref>|: {number(largest)} V, without response {number(avoided)} V")
    overall = made.assessment.overall.get(made.assessment.main)
    if overall is not None:
        rate = overall.rates.false_alarm_rate
        alarms = "false alarms" if made.timeline.labelled else "alarms (not known whether false)"
        lines.append(
            f"{alarms}: {overall.rates.false_alarms}; {share(rate.value)} of {overall.rates.quiet_samples} "
            f"quiet samples {interval(rate, percent=True)}"
        )
        if made.assessment.attacks:
            lines.append(f"attacked samples with an alarm: {share(overall.rates.seen_rate.value)}")
        if (hardest := made.assessment.hardest) is not None and hardest.roc is not None:
            area, link = hardest.roc.area, hardest.row.link
            found = f"{number(area.value, 4)} {interval(area, digits=4)}".rstrip()
            lines.append(f"least area under a ROC: {found}, link {link}")
    return [*lines, f"page: {made.html}", f"data: {made.json}"]
