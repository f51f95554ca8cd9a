"""`dcmg node`: single nodes of a run by hand."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 (typer reads the annotations)
from typing import Annotated

import typer

from bags.mcap.recording import ChunkPreset
from dcmg.commands import recording_options as recorded
from dcmg.commands import scenario_options as options
from dcmg_bringup.domain import checked_domain
from dcmg_bringup.run_command import in_time
from dcmg_bringup.said import said_in_one_line
from dcmg_nodes.options import NodeOptions, PacingMode

_EXIT_FAILED = 1


def node(
    names: Annotated[
        list[str], typer.Argument(metavar="NAME...", help="clock, dgu_1, attacker, monitor_1, recorder, …")
    ],
    *,
    scenario: Annotated[str, typer.Option(help="name of a shipped scenario or path of a file")],
    out: Annotated[Path, typer.Option(help="folder of the run; the recorder writes its bag there")],
    pacing: Annotated[PacingMode, typer.Option(help="of the clock")] = PacingMode.LOCKSTEP,
    rate: Annotated[float, typer.Option(min=0.001, help="real-time factor of the clock")] = 1.0,
    start_timeout: Annotated[float, typer.Option(min=0.0, help="how long to wait for all nodes [s]")] = 30.0,
    stall_timeout: Annotated[
        float, typer.Option(min=0.0, help="how long to wait for the next step of a run that has begun [s]")
    ] = 8.0,
    set_: options.Set = None,
    designs: options.Designs = None,
    bag_compression: recorded.BagCompression = recorded.CompressionName.ZSTD,
    bag_chunks: recorded.BagChunks = ChunkPreset.SAFE,
    bag_split_mb: recorded.BagSplitMb = None,
    bag_split_sec: recorded.BagSplitSec = None,
    bag_topics: recorded.BagTopics = None,
    bag_exclude: recorded.BagExclude = None,
    bag_buffer_mb: recorded.BagBufferMb = 32.0,
    bag_when_full: recorded.BagWhenFull = None,
) -> None:
    """Start single nodes of a run: what `dcmg run` supervises, by hand, on this or another host.

    The run starts when all nodes of the scenario are there, told the same scenario; a node says whom it waits for, and
    gives up with exit code 1. ROS_DOMAIN_ID and the other ROS variables are yours to set.
    """
    recording = recorded.recording_of(
        compression=bag_compression,
        chunks=bag_chunks,
        split_mb=bag_split_mb,
        split_sec=bag_split_sec,
        topics=bag_topics,
        exclude=bag_exclude,
        buffer_mb=bag_buffer_mb,
        when_full=bag_when_full,
        in_time=in_time(pacing),
    )
    chosen = options.ScenarioOptions(name=scenario, duration_sec=None, seed=None, out=None, overrides=set_ or [])
    how = NodeOptions(
        out=out,
        pacing=pacing,
        rate=rate,
        start_timeout_sec=start_timeout,
        stall_timeout_sec=stall_timeout,
        recording=recording,
        designs=designs,
        alone=True,
    )
    checked_domain(None)
    from dcmg.commands.checking import check_monitors  # noqa: PLC0415 (heavy)
    from dcmg_nodes.main import run_nodes  # noqa: PLC0415 (imports rclpy)

    loaded = chosen.load()
    check_monitors(loaded, chosen, designs)
    with said_in_one_line():
        failure = run_nodes(names, loaded, how)
    if failure is not None:
        typer.echo(f"dcmg: {failure}", err=True)
        raise typer.Exit(_EXIT_FAILED)
