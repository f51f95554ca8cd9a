"""`dcmg monitor`: monitors on live topics that are not ours."""

from __future__ import annotations

import json as json_module
import os
from dataclasses import asdict
from pathlib import Path  # noqa: TC003 (typer reads the annotations)
from typing import Annotated

import typer

from dcmg_bringup.domain import checked_domain
from dcmg_bringup.said import said_in_one_line


def monitor(
    mapping: Annotated[Path, typer.Argument(help="mapping file (docs/import.md): its streams are monitored")],
    *,
    history: Annotated[Path, typer.Option(metavar="BAG", help="bag with a history of each watched DGU")],
    out: Annotated[
        Path | None, typer.Option(metavar="BAG", help="record what was received and concluded", show_default=False)
    ] = None,
    duration: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="end after so much; default: on Ctrl-C", show_default=False)
    ] = None,
    wait: Annotated[float, typer.Option(metavar="SECONDS", help="how long the topics are waited for [s]")] = 30.0,
    domain: Annotated[
        int | None, typer.Option(help="ROS domain id; default: that of the environment", show_default=False)
    ] = None,
    json: Annotated[
        bool, typer.Option("--json", help="print the result as one JSON document on the last line")
    ] = False,
) -> None:
    """Attach monitors to live ROS 2 topics of any message type, and tell alarms as they come.

    Publishes /dgu_j/residual/dgu_i, /dgu_j/alarms, /dgu_j/received/dgu_i, /dgu_j/design/dgu_i, /dgu_j/stream and
    /diagnostics. No simulator, clock or tick of ours is needed; ROS variables of the environment apply.
    """
    from bags.foreign.mapping import load_mapping  # noqa: PLC0415 (heavy)
    from bags.foreign.stream_monitors import stream_monitors  # noqa: PLC0415 (heavy)

    found_domain = checked_domain(domain)
    found = load_mapping(mapping)
    monitors = stream_monitors(found, str(mapping), history)
    for record in monitors.designs:
        typer.echo(f"link {record.source}-{record.monitor}: {record.verdict}", err=True)
    if found_domain is not None:
        os.environ["ROS_DOMAIN_ID"] = str(found_domain)
    from dcmg_nodes.foreign_main import watch_foreign_topics  # noqa: PLC0415 (rclpy only when needed)

    period_sec = monitors.topics.sampling_period_ns * 1e-9
    steps = None if duration is None else max(1, round(duration / period_sec))
    typer.echo(f"waiting for {' '.join(monitors.fields)}", err=True)
    with said_in_one_line():
        outcome = watch_foreign_topics(found, monitors, wait_sec=wait, steps=steps, out=out, say=typer.echo)
    if json:
        typer.echo(json_module.dumps({**asdict(outcome), "bag": None if out is None else str(out)}))
        return
    typer.echo(f"{outcome.steps} samples, {outcome.alarms} alarm(s)", err=True)
    for name, count in outcome.not_finite.items():
        typer.echo(f"{name}: {count} samples are no finite numbers and count as missing", err=True)
    for count, what in (
        (outcome.missing, "samples are missing"),
        (outcome.late, "messages came too late or out of order and were dropped"),
        (outcome.irregular, "messages were at no instant of the grid and count as missing: see sampling.policy"),
        (outcome.restarts, "times the stamps jumped and the grid started anew"),
    ):
        if count:
            typer.echo(f"{count} {what}", err=True)
