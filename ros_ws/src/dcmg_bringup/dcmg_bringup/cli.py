"""The `dcmg` command."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # our matrices are small; a process with threads must not fork

import typer

from bags.mcap.errors import BagError
from bags.mcap.recording import ChunkPreset
from dcmg.commands import bag, imports, measure, paper
from dcmg.commands.avoided import avoided
from dcmg.commands.design import design
from dcmg.commands.reconstruct import reconstruct
from dcmg.commands.report import report
from dcmg.commands.study import study
from dcmg.errors import CommandError
from dcmg_bringup import attack_commands, jobs, player_commands
from dcmg_bringup.monitor_command import monitor
from dcmg_bringup.recording_options import (
    BagBufferMb,
    BagChunks,
    BagCompression,
    BagExclude,
    BagSplitMb,
    BagSplitSec,
    BagTopics,
    BagWhenFull,
    CompressionName,
    recording_of,
)
from dcmg_bringup.replay_command import replay
from dcmg_bringup.soak_command import soak
from dcmg_nodes.errors import NodeError
from dcmg_nodes.options import NodeOptions, PacingMode
from dgu_sim.errors import DguSimError
from monitor.errors import MonitorError

_EXIT_ERROR = 2

app = typer.Typer(
    name="dcmg",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="""Would an attack on a DC microgrid's communication be noticed?

Runs microgrid scenarios over ROS 2 (`run`) or without it (`simulate`), with an attacker on the communication links and
data-driven unknown-input observers watching; every run ends in a bag that `replay` evaluates again.

Start here: `dcmg scenarios`, then `dcmg run gallo_six_dgu`.""",
)
app.add_typer(attack_commands.app, name="attack")
app.add_typer(paper.app, name="paper")
app.add_typer(measure.app, name="measure")
app.add_typer(bag.app, name="bag")
app.add_typer(imports.app, name="import")
app.add_typer(player_commands.app, name="player")
app.command("avoided")(avoided)
app.command("design")(design)
app.command("replay")(replay)
app.command("monitor")(monitor)
app.command("reconstruct")(reconstruct)
app.command("report")(report)
app.command("soak")(soak)
app.command("study")(study)

Scenario = Annotated[str, typer.Argument(help="name of a shipped scenario (see `dcmg scenarios`) or path of a file")]
Out = Annotated[
    Path | None, typer.Option(help="folder to write to; default: out/<scenario>-<date>-<time>", show_default=False)
]
Json = Annotated[bool, typer.Option("--json", help="print the result as one JSON document, and nothing else there")]
Duration = Annotated[
    float | None, typer.Option(metavar="SECONDS", help="simulated length of the run [s]", show_default=False)
]
Seed = Annotated[int | None, typer.Option(help="seed of everything random", show_default=False)]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="A.B=VALUE", help="change one key of the scenario; repeatable", show_default=False),
]
History = Annotated[
    Path | None,
    typer.Option(
        metavar="BAG",
        help="design the monitors from this recorded history (see `dcmg experiment`), not from one made at the start",
        show_default=False,
    ),
]
Plots = Annotated[bool, typer.Option(help="draw states and residuals as PNG files")]


@app.command()
def run(
    scenario: Scenario,
    *,
    pacing: Annotated[
        PacingMode, typer.Option(help="as fast as the nodes go, or wall-clock time")
    ] = PacingMode.LOCKSTEP,
    rate: Annotated[float, typer.Option(min=0.001, help="real-time factor, with `--pacing realtime`")] = 1.0,
    duration: Duration = None,
    seed: Seed = None,
    out: Out = None,
    composed: Annotated[bool, typer.Option("--composed", help="all nodes in one process")] = False,
    history: History = None,
    set_: Set = None,
    json: Json = False,
    plots: Plots = True,
    domain: Annotated[int | None, typer.Option(help="ROS domain id; default: a free one", show_default=False)] = None,
    bag_compression: BagCompression = CompressionName.ZSTD,
    bag_chunks: BagChunks = ChunkPreset.SAFE,
    bag_split_mb: BagSplitMb = None,
    bag_split_sec: BagSplitSec = None,
    bag_topics: BagTopics = None,
    bag_exclude: BagExclude = None,
    bag_buffer_mb: BagBufferMb = 32.0,
    bag_when_full: BagWhenFull = None,
) -> None:
    """Run a scenario over ROS 2: one process per node, recorded to a bag."""
    options = jobs.ScenarioOptions(
        name=scenario, duration_sec=duration, seed=seed, out=out, overrides=set_ or [], history=history
    )
    recording = recording_of(
        compression=bag_compression,
        chunks=bag_chunks,
        split_mb=bag_split_mb,
        split_sec=bag_split_sec,
        topics=bag_topics,
        exclude=bag_exclude,
        buffer_mb=bag_buffer_mb,
        when_full=bag_when_full,
        pacing=pacing,
    )
    raise typer.Exit(
        jobs.run(
            options,
            pacing=pacing,
            rate=rate,
            composed=composed,
            domain=domain,
            recording=recording,
            json=json,
            plots=plots,
        )
    )


@app.command()
def simulate(
    scenario: Scenario,
    *,
    duration: Duration = None,
    seed: Seed = None,
    out: Out = None,
    history: History = None,
    set_: Set = None,
    json: Json = False,
    plots: Plots = True,
    bag_compression: BagCompression = CompressionName.ZSTD,
    bag_chunks: BagChunks = ChunkPreset.COMPACT,
    bag_split_mb: BagSplitMb = None,
    bag_split_sec: BagSplitSec = None,
    bag_topics: BagTopics = None,
    bag_exclude: BagExclude = None,
) -> None:
    """Do the same run without ROS: the same numbers bit for bit, the same bag, much faster."""
    options = jobs.ScenarioOptions(
        name=scenario, duration_sec=duration, seed=seed, out=out, overrides=set_ or [], history=history
    )
    recording = recording_of(
        compression=bag_compression,
        chunks=bag_chunks,
        split_mb=bag_split_mb,
        split_sec=bag_split_sec,
        topics=bag_topics,
        exclude=bag_exclude,
    )
    raise typer.Exit(jobs.simulate(options, recording=recording, json=json, plots=plots))


@app.command()
def experiment(
    scenario: Scenario,
    *,
    dgu: Annotated[list[int] | None, typer.Option(help="number of a DGU; repeatable; default: all of them")] = None,
    seed: Seed = None,
    out: Out = None,
    set_: Set = None,
) -> None:
    """Run the offline experiment of DGUs and write their histories as a bag, from which monitors are designed."""
    options = jobs.ScenarioOptions(name=scenario, duration_sec=None, seed=seed, out=out, overrides=set_ or [])
    raise typer.Exit(jobs.experiment(options, dgus=dgu or []))


@app.command()
def scenarios() -> None:
    """List the shipped scenarios."""
    jobs.list_scenarios()


@app.command()
def node(
    names: Annotated[
        list[str], typer.Argument(metavar="NAME...", help="clock, dgu_1, attacker, monitor_1, recorder, …")
    ],
    *,
    scenario: Annotated[str, typer.Option(help="name of a shipped scenario or path of a file")],
    out: Annotated[Path, typer.Option(help="folder of the run; the recorder writes its bag there")],
    pacing: Annotated[PacingMode, typer.Option(help="of the clock")] = PacingMode.LOCKSTEP,
    rate: Annotated[float, typer.Option(min=0.001, help="real-time factor of the clock")] = 1.0,
    start_timeout: Annotated[float, typer.Option(help="how long the clock waits for all nodes [s]")] = 30.0,
    set_: Set = None,
    bag_compression: BagCompression = CompressionName.ZSTD,
    bag_chunks: BagChunks = ChunkPreset.SAFE,
    bag_split_mb: BagSplitMb = None,
    bag_split_sec: BagSplitSec = None,
    bag_topics: BagTopics = None,
    bag_exclude: BagExclude = None,
    bag_buffer_mb: BagBufferMb = 32.0,
    bag_when_full: BagWhenFull = None,
) -> None:
    """Start single nodes of a run: what `dcmg run` supervises, by hand, on this or another host.

    The run starts when all nodes of the scenario are there. ROS_DOMAIN_ID and the other ROS variables are yours to set.
    """
    recording = recording_of(
        compression=bag_compression,
        chunks=bag_chunks,
        split_mb=bag_split_mb,
        split_sec=bag_split_sec,
        topics=bag_topics,
        exclude=bag_exclude,
        buffer_mb=bag_buffer_mb,
        when_full=bag_when_full,
        pacing=pacing,
    )
    options = NodeOptions(out=out, pacing=pacing, rate=rate, start_timeout_sec=start_timeout, recording=recording)
    raise typer.Exit(jobs.node(names, scenario, set_ or [], options))


def main() -> None:
    """Run the command; an expected error becomes one line on standard error and exit code 2."""
    try:
        app()
    except (BagError, CommandError, DguSimError, MonitorError, NodeError) as error:
        sys.stderr.write(f"dcmg: {error}\n")
        sys.exit(_EXIT_ERROR)


if __name__ == "__main__":
    main()
