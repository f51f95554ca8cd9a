"""`dcmg run`: a scenario over ROS 2."""

from __future__ import annotations

import signal
from contextlib import closing
from pathlib import Path  # noqa: TC003 (typer reads the annotations)
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from bags.mcap.recording import ChunkPreset, WhenFull
from dcmg.commands import recording_options as recorded
from dcmg.commands import scenario_options as options
from dcmg.commands.page import check_installed
from dcmg.errors import CommandError
from dcmg_nodes.options import PacingMode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bags.mcap.recording import Recording
    from dcmg_bringup.run_job import RunOptions, RunOutcome
    from dgu_sim.scenario import Scenario

FOREVER = "forever"
_FOREVER_SEC = 1e7  # four months: nobody waits for its end
_EXIT_FAILED = 1
_EXIT_INTERRUPTED = 130


def run(
    scenario: options.Scenario,
    *,
    pacing: Annotated[
        PacingMode, typer.Option(help="as fast as the nodes go, or wall-clock time")
    ] = PacingMode.LOCKSTEP,
    rate: Annotated[float, typer.Option(min=0.001, help="real-time factor, with `--pacing realtime`")] = 1.0,
    duration: Annotated[
        str | None,
        typer.Option(
            metavar="SECONDS|forever",
            help="length of the run [s]; forever, the default in real time if no `--set` tells: until Ctrl-C",
            show_default=False,
        ),
    ] = None,
    seed: options.Seed = None,
    out: options.Out = None,
    composed: Annotated[bool, typer.Option("--composed", help="all nodes in one process")] = False,
    history: options.History = None,
    designs: options.Designs = None,
    set_: options.Set = None,
    json: options.Json = False,
    plots: options.Plots = True,
    anyway: options.Anyway = False,
    page: Annotated[
        bool, typer.Option("--page", help="show the run in a browser as it goes on (docs/page.md)")
    ] = False,
    domain: Annotated[
        int | None, typer.Option(help="ROS domain id; default: ROS_DOMAIN_ID, else a free one", show_default=False)
    ] = None,
    hosts: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="several machines: which node runs where (docs/hosts.md)", show_default=False
        ),
    ] = None,
    bag_compression: recorded.BagCompression = recorded.CompressionName.ZSTD,
    bag_chunks: recorded.BagChunks = ChunkPreset.SAFE,
    bag_split_mb: recorded.BagSplitMb = None,
    bag_split_sec: recorded.BagSplitSec = None,
    bag_topics: recorded.BagTopics = None,
    bag_exclude: recorded.BagExclude = None,
    bag_buffer_mb: recorded.BagBufferMb = 32.0,
    bag_when_full: recorded.BagWhenFull = None,
) -> None:
    """Run a scenario over ROS 2: one process per node, recorded to a bag."""
    chosen = options.ScenarioOptions(
        name=scenario,
        duration_sec=_duration_sec(duration, pacing, set_ or []),
        seed=seed,
        out=out,
        overrides=set_ or [],
        history=history,
        anyway=anyway,
    )
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
    if rate != 1.0 and pacing is PacingMode.LOCKSTEP:
        raise CommandError(f"--rate {rate:g}: expected only together with --pacing realtime")
    if page:
        check_installed()
    from dcmg_bringup.domain import checked_domain  # noqa: PLC0415 (not for the help)
    from dcmg_bringup.hosts.hosts_file import load_hosts  # noqa: PLC0415 (heavy)
    from dcmg_bringup.run_job import RunOptions  # noqa: PLC0415 (heavy)

    how = RunOptions(
        pacing=pacing,
        rate=rate,
        composed=composed,
        domain=checked_domain(domain),
        recording=recording,
        designs=designs,
        page=page,
        hosts=None if hosts is None else load_hosts(hosts),
        hosts_source=str(hosts),
    )
    code = _run(chosen, how, json=json, plots=plots)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, signal.SIG_IGN)  # all is done and said: nothing changes the exit code any more
    raise typer.Exit(code)


def _duration_sec(text: str | None, pacing: PacingMode, overrides: Sequence[str]) -> float | None:
    """Read --duration; None: as the scenario and its overrides say."""
    is_told = any(override.partition("=")[0].strip() == "duration_sec" for override in overrides)
    if text == FOREVER or (text is None and pacing is PacingMode.REALTIME and not is_told):
        return _FOREVER_SEC
    try:
        return None if text is None else float(text)
    except ValueError:
        raise CommandError(f"--duration {text}: expected a number of seconds, or {FOREVER}") from None


def in_time(pacing: PacingMode) -> WhenFull:
    """What a recorder does whose buffer is full: in real time the run does not wait for a disk."""
    return WhenFull.WAIT if pacing is PacingMode.LOCKSTEP else WhenFull.DROP


def _run(chosen: options.ScenarioOptions, how: RunOptions, *, json: bool, plots: bool) -> int:
    """Run a scenario over ROS 2 and show what the monitors saw."""
    from dcmg.commands.checking import check_monitors  # noqa: PLC0415 (heavy)
    from dcmg.commands.showing import messages  # noqa: PLC0415 (takes its time)
    from dcmg.live import LiveDisplay  # noqa: PLC0415 (takes its time)
    from dcmg_bringup.run_job import run_job  # noqa: PLC0415 (heavy)

    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends like Ctrl-C before and after the nodes run, too
    scenario = chosen.load()
    check_monitors(scenario, chosen, how.designs)
    out = chosen.folder(scenario)
    steps = None if _is_forever(scenario) else scenario.steps
    with closing(LiveDisplay(messages, steps, scenario.sampling_period_sec)) as display:
        outcome = run_job(scenario, out, how, display)
    return _ended(outcome, scenario, out, how.recording, json=json, plots=plots)


def _ended(outcome: RunOutcome, scenario: Scenario, out: Path, recording: Recording, *, json: bool, plots: bool) -> int:
    from dcmg.commands.showing import is_partial, messages, show  # noqa: PLC0415 (takes its time)

    if outcome.lost:
        messages.print(
            f"[red]{outcome.lost} message(s) were published and not recorded[/]: see {escape(str(out / 'log'))}"
        )
    if outcome.deadline_misses:
        messages.print(f"{outcome.deadline_misses} step(s) were released more than one sampling period late")
    if outcome.failure is not None:
        messages.print(
            f"dcmg: {outcome.failure}; the bag holds what came before: {outcome.bag}",
            highlight=False,
            markup=False,
            soft_wrap=True,
        )
        return _EXIT_FAILED
    if outcome.interrupted and not outcome.steps:
        messages.print("interrupted before the first step was recorded")
        return _EXIT_INTERRUPTED
    if outcome.interrupted:
        messages.print(
            f"interrupted at step {outcome.steps}; the bag is closed: {outcome.bag}",
            highlight=False,
            markup=False,
            soft_wrap=True,
        )
    partial = is_partial(scenario, recording)
    show(outcome.bag, out if plots else None, json=json, partial=partial, strangers=outcome.strangers)
    if outcome.interrupted and not _is_forever(scenario):
        return _EXIT_INTERRUPTED
    return _EXIT_FAILED if outcome.lost else 0


def _is_forever(scenario: Scenario) -> bool:
    return scenario.duration_sec == _FOREVER_SEC
