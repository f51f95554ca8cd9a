"""What the commands do, once their arguments are parsed: each returns the exit code."""

from __future__ import annotations

import datetime as dt
import json as json_module
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from dcmg.errors import CommandError
from dcmg.live import LiveDisplay
from dcmg.shipped import scenario_path, shipped_scenarios
from dcmg_nodes.options import PacingMode
from dgu_sim.scenario import load_scenario

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from bags.mcap.recording import Recording
    from bags.reporting.report import RunSummary
    from bags.reporting.team_outline import TeamOutline
    from bags.runs.run_record import RunRecord
    from dcmg_nodes.options import NodeOptions
    from dgu_sim.scenario import Scenario

_EXIT_FAILED = 1
_EXIT_INTERRUPTED = 130
_PLOTS = "plots"

# Progress and messages go to standard error, so that standard output carries the result alone.
_messages = Console(stderr=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenarioOptions:
    """Which scenario, and what is changed in it.

    Attributes:
        name: name of a shipped scenario or path of a file.
        duration_sec: simulated length [s], None: as in the file.
        seed: seed, None: as in the file.
        out: folder to write to, None: a new one below `out`.
        overrides: further changes, "a.b=value".
        history: bag with the histories that monitors are designed from, None: as in the file.
    """

    name: str
    duration_sec: float | None
    seed: int | None
    out: Path | None
    overrides: Sequence[str]
    history: Path | None = None

    def load(self) -> Scenario:
        """Read and check the scenario.

        Raises:
            ScenarioError: it is not valid.
        """
        changes = list(self.overrides)
        if self.duration_sec is not None:
            changes.append(f"duration_sec={self.duration_sec!r}")
        if self.seed is not None:
            changes.append(f"seed={self.seed}")
        if self.history is not None:
            changes.append(f"history.bag={json_module.dumps(str(self.history.resolve()))}")
        return load_scenario(scenario_path(self.name), changes)

    def folder(self, scenario: Scenario) -> Path:
        """Return the folder to write to, which does not hold anything yet.

        Raises:
            CommandError: the wanted folder holds something.
        """
        now = dt.datetime.now(tz=dt.UTC).astimezone()
        out = self.out or Path("out") / f"{scenario.name}-{now:%Y%m%d-%H%M%S}"
        if out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise CommandError(f"--out {out}: expected a new or empty folder, found one that holds something")
        return out


def run(
    options: ScenarioOptions,
    *,
    pacing: PacingMode,
    rate: float,
    composed: bool,
    domain: int | None,
    recording: Recording,
    json: bool,
    plots: bool,
) -> int:
    """Run a scenario over ROS 2 and show what the monitors saw."""
    from dcmg_bringup.run_job import RunOptions, run_job  # noqa: PLC0415 (rclpy only when needed)

    if rate != 1.0 and pacing is PacingMode.LOCKSTEP:
        raise CommandError(f"--rate {rate:g}: expected only together with --pacing realtime")
    scenario = options.load()
    check_monitors(scenario)
    out = options.folder(scenario)
    run_options = RunOptions(pacing=pacing, rate=rate, composed=composed, domain=domain, recording=recording)
    with LiveDisplay(_messages, scenario.steps, scenario.sampling_period_sec) as display:
        outcome = run_job(scenario, out, run_options, display)
    if outcome.lost:
        _messages.print(f"[red]{outcome.lost} message(s) were published and not recorded[/]: see {out / 'log'}")
    if outcome.deadline_misses:
        _messages.print(f"{outcome.deadline_misses} step(s) were released more than one sampling period late")
    if outcome.failure is not None:
        _messages.print(
            f"dcmg: {outcome.failure}; the bag holds what came before: {outcome.bag}", highlight=False, soft_wrap=True
        )
        return _EXIT_FAILED
    if outcome.interrupted:
        _messages.print(
            f"interrupted at step {outcome.steps}; the bag is closed: {outcome.bag}", highlight=False, soft_wrap=True
        )
        return _EXIT_INTERRUPTED
    _show(outcome.bag, out if plots else None, json=json, partial=_is_partial(scenario, recording))
    return _EXIT_FAILED if outcome.lost else 0


def simulate(options: ScenarioOptions, *, recording: Recording, json: bool, plots: bool) -> int:
    """Do the same run without ROS."""
    from bags.runs.offline import simulate_to_bag  # noqa: PLC0415 (heavy)
    from bags.runs.origin import host_facts  # noqa: PLC0415

    scenario = options.load()
    check_monitors(scenario)
    out = options.folder(scenario)
    out.mkdir(parents=True, exist_ok=True)
    with LiveDisplay(_messages, scenario.steps, scenario.sampling_period_sec) as display:
        bag = simulate_to_bag(scenario, out / "bag", display.steps, recording, host_facts())
    _show(bag, out if plots else None, json=json, partial=_is_partial(scenario, recording))
    return 0


def experiment(options: ScenarioOptions, *, dgus: Sequence[int]) -> int:
    """Write the offline experiments of DGUs as a bag of histories."""
    from bags.watch.histories import write_histories  # noqa: PLC0415 (heavy)

    scenario = options.load()
    known = [dgu.id for dgu in scenario.dgus]
    for dgu in dgus:
        if dgu not in known:
            raise CommandError(f"--dgu {dgu}: scenario {scenario.name} has {', '.join(map(str, known))}")
    out = options.folder(scenario)
    out.mkdir(parents=True, exist_ok=True)
    bag = write_histories(scenario, dgus or known, out / "history")
    Console().print(f"histories of DGU {', '.join(map(str, dgus or known))}: {bag}", highlight=False, soft_wrap=True)
    return 0


def list_scenarios() -> None:
    """Print name and description of each shipped scenario."""
    table = Table("scenario", "what it is", box=None)
    for name, path in shipped_scenarios().items():
        table.add_row(name, " ".join(load_scenario(path).description.split()))
    Console().print(table)


def node(names: Sequence[str], scenario: str, overrides: Sequence[str], options: NodeOptions) -> int:
    """Run single nodes until the run ends."""
    from dcmg_nodes.main import run_nodes  # noqa: PLC0415 (rclpy only when needed)

    failure = run_nodes(names, load_scenario(scenario_path(scenario), overrides), options)
    if failure is not None:
        raise CommandError(failure)
    return 0


def check_monitors(scenario: Scenario) -> None:
    """Design every observer and build the detector once, so that a run does not start in vain.

    Raises:
        MonitorError: an unknown kind or option, or a history that cannot be used.
        BagError: the bag of histories cannot be read.
    """
    from bags.watch.histories import histories_of_run  # noqa: PLC0415
    from bags.wire.convert import history_of  # noqa: PLC0415 (heavy)
    from monitor import detectors, observers  # noqa: PLC0415

    detector, observer = scenario.monitor.detector, scenario.monitor.observer
    detectors.build(detector.kind, detector.options, scenario.sampling_period_sec)
    for source in sorted({link.source for link in scenario.links}):
        history = history_of(histories_of_run(scenario, source))
        design = observers.design(observer.kind, history, observer.options)
        if not design.accepted:
            _messages.print(f"[yellow]links from DGU {source} are not monitored[/]: {design.verdict}", soft_wrap=True)
    if scenario.monitor.team is not None:
        from bags.watch.team import design_of  # noqa: PLC0415 (heavy)

        team = design_of(scenario)
        if not team.accepted:
            _messages.print(f"[yellow]no team[/]: {team.verdict}", soft_wrap=True)


def _say(line: str) -> None:
    """Print one line, however long, to standard error."""
    _messages.print(line, highlight=False, soft_wrap=True)


def _show(bag: Path, plots_dir: Path | None, *, json: bool, partial: bool) -> None:
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

        with _messages.status("drawing"):
            pictures = draw(found, plots_dir / _PLOTS)
    print_summary(summary(found, bag), pictures, json=json)


def _is_partial(scenario: Scenario, recording: Recording) -> bool:
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
    with Progress(console=_messages, transient=True) as progress:
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
