"""`dcmg import`: other people's bags and tables as histories and received streams."""

from __future__ import annotations

import json as json_module
import shutil
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.progress import Progress, TaskID

from bags.foreign.sampling import Policy
from bags.foreign.stamps import Stamps
from dcmg.commands.definitions import EXIT_LEFT_OUT, Definitions, known_definitions
from dcmg.errors import CommandError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from bags.foreign.importing import ImportReport
    from bags.foreign.mapping import Mapping
    from bags.foreign.outline import Described

_EXIT_UNFIT = 1
_COMMAND_LINE = "command line"

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="""Bring measurements of other programs in: bags (rosbag2 with MCAP or sqlite3, ROS 1), tables, flight logs.

A *field* is `/topic.field.inner[0]` in a bag and the name of a column in a table; `field*factor` brings it to SI units.
A mapping file says the same and more: docs/import.md. Start with `dcmg import inspect SOURCE`.""",
)

Source = Annotated[
    Path, typer.Argument(help="rosbag2 folder, .mcap, .db3 or .bag file; table; ULog", show_default=False)
]
MappingFile = Annotated[
    Path | None, typer.Option("--mapping", metavar="FILE", help="mapping file; the options below change it")
]
Out = Annotated[Path, typer.Option(help="bag to write; must not exist")]
Y = Annotated[list[str] | None, typer.Option(help="field of an output; repeatable, in order")]
Time = Annotated[str | None, typer.Option(metavar="COLUMN", help="instants of a table, times its factor in seconds")]
Period = Annotated[float | None, typer.Option(metavar="SECONDS", help="sampling period [s]; default: detected")]
StampsOption = Annotated[Stamps | None, typer.Option(help="clock of a bag's messages; default: auto")]
PolicyOption = Annotated[
    Policy | None, typer.Option(help="what stands for the sample at an instant; default: refuse what is irregular")
]
Tolerance = Annotated[float | None, typer.Option(help="share of the period by which an instant may be off [0.01]")]
MaxGap = Annotated[float | None, typer.Option(metavar="SECONDS", help="longest time that hold or linear bridges [s]")]
Json = Annotated[bool, typer.Option("--json", help="print the result as one JSON document, and nothing else there")]


@app.callback()
def main() -> None:
    """Bring measurements of other programs in."""


@app.command()
def inspect(source: Source, *, definitions: Definitions = None, json: Json = False) -> None:
    """Show what a bag or table holds: topics, numeric fields, period, jitter, gaps.

    Exit code 3 when a topic with messages cannot be read: it is named, counted and left out.
    """
    from bags.foreign.outline import describe_source  # noqa: PLC0415 (heavy)

    found = describe_source(source, known_definitions(definitions))
    if json:
        typer.echo(json_module.dumps([one.document() for one in found.topics]))
    else:
        for line in found.notes:
            typer.echo(line)
        for one in found.topics:
            _show_topic(one)
    if found.left_out:
        names = ", ".join(f"{one.name} ({one.messages} messages)" for one in found.left_out)
        typer.echo(f"left out, because it cannot be read: {names}", err=True)
        raise typer.Exit(EXIT_LEFT_OUT)


@app.command()
def history(
    source: Source,
    *,
    out: Out,
    mapping: MappingFile = None,
    dgu: Annotated[int | None, typer.Option(min=1, help="number of the DGU that was measured")] = None,
    y: Y = None,
    x: Annotated[list[str] | None, typer.Option(help="field of a state; default: the outputs are the states")] = None,
    u: Annotated[list[str] | None, typer.Option(help="field of a known input; default: none")] = None,
    d: Annotated[
        list[str] | None, typer.Option(help="field of an input applied, unknown online; default: none")
    ] = None,
    w: Annotated[list[str] | None, typer.Option(help="field that only the DGU itself measures; default: none")] = None,
    time: Time = None,
    period: Period = None,
    stamps: StampsOption = None,
    policy: PolicyOption = None,
    tolerance: Tolerance = None,
    max_gap: MaxGap = None,
    definitions: Definitions = None,
    json: Json = False,
) -> None:
    """Write measurements as a history, from which `dcmg design`, `run --history` and `monitor` design observers."""
    from bags.foreign.importing import import_histories  # noqa: PLC0415 (heavy)

    entry = {"dgu": dgu, "y": y, "x": x, "u": u, "d": d, "w": w}
    changes = _changes(time=time, period=period, stamps=stamps, policy=policy, tolerance=tolerance, max_gap=max_gap)
    found = _mapping(mapping, "histories", entry, needed=("dgu", "y"), changes=changes)
    known = known_definitions(definitions)
    report = _with_progress(lambda progress: import_histories(source, found, out, known=known, progress=progress))
    counts = ", ".join(f"{count} of DGU {number}" for number, count in report.experiments.items())
    _tell(report, f"{report.samples} samples in experiments ({counts}) are in {out}", json=json)


@app.command(context_settings={"allow_extra_args": True, "ignore_unknown_options": True})
def stream(
    context: typer.Context,
    source: Source,
    *,
    out: Out,
    mapping: MappingFile = None,
    link: Annotated[str | None, typer.Option(metavar="I-J", help="from the watched DGU to the receiving one")] = None,
    y: Y = None,
    u: Annotated[list[str] | None, typer.Option(help="field of a known input of the sender; default: none")] = None,
    delivered: Annotated[str | None, typer.Option(metavar="FIELD", help="0 where the sample was lost")] = None,
    history: Annotated[
        Path | None, typer.Option(metavar="BAG", help="histories of the watched DGUs, copied into the bag")
    ] = None,
    attack: Annotated[
        str | None, typer.Option(metavar="KIND", help="falsify the link as an attacker on it would, and label that")
    ] = None,
    start: Annotated[float, typer.Option(metavar="SECONDS", help="first falsified sample [s]")] = 0.0,
    stop: Annotated[float | None, typer.Option(metavar="SECONDS", help="first clean sample again [s]")] = None,
    seed: Annotated[int | None, typer.Option(help="seed of attacks that draw random numbers [0]")] = None,
    time: Time = None,
    period: Period = None,
    stamps: StampsOption = None,
    policy: PolicyOption = None,
    tolerance: Tolerance = None,
    max_gap: MaxGap = None,
    definitions: Definitions = None,
    json: Json = False,
) -> None:
    """Write measurements as received outputs, which `dcmg replay` monitors.

    With `--attack KIND` the parameters of the attack follow, as in `--attack bias --bias 0.1 0.1 0.1 --start 4`: the
    recording is falsified as an attacker on the link would, and labelled, so that delay, missed and false alarms are
    measured. `dcmg attack kinds` lists the kinds; those that need a running grid are refused.
    """
    from bags.foreign.importing import import_streams  # noqa: PLC0415 (heavy)

    entry = {"link": link, "y": y, "u": u, "delivered": delivered}
    changes = _changes(time=time, period=period, stamps=stamps, policy=policy, tolerance=tolerance, max_gap=max_gap)
    changes |= _given({"seed": seed})
    if attack is not None:
        link = link or _only_link(mapping)
        changes["attacks"] = [_ordered(attack, str(link), context.args, start, stop)]
        entry = {} if mapping is not None and not (y or u or delivered) else entry
    elif context.args:
        raise CommandError(
            f"{context.args[0]}: no such option or argument, expected --attack KIND before its parameters"
        )
    found = _mapping(mapping, "streams", entry, needed=("link", "y"), changes=changes)
    known = known_definitions(definitions)
    report = _with_progress(
        lambda progress: import_streams(source, found, out, history, known=known, progress=progress)
    )
    _tell(report, f"{report.samples} samples of {len(found.streams)} link(s) are in {out}", json=json)


@app.command("check-history")
def check_history(
    bag: Annotated[Path, typer.Argument(help="bag of a run, or of `dcmg import stream`", show_default=False)],
    *,
    history: Annotated[
        Path | None, typer.Option(metavar="BAG", help="histories of the watched DGUs; default: those in the bag")
    ] = None,
    link: Annotated[str | None, typer.Option(metavar="I-J", help="the one to judge; default: all")] = None,
    unknown_inputs: Annotated[int | None, typer.Option(min=0, help="of the history, when it is known")] = None,
    received_std: Annotated[
        str, typer.Option(metavar="V,A,VS", help="noise on what was received, one number or one an output")
    ] = "0",
    window: Annotated[
        int | None, typer.Option(min=2, help="samples judged together; default: twice the states")
    ] = None,
    every: Annotated[float, typer.Option(min=0.0, metavar="SECONDS", help="one misfit for every so many")] = 1.0,
    json: Json = False,
) -> None:
    """Tell whether received streams still fit the histories that their monitors learned from (T, definition 5).

    Exit code 1 when one does not fit, 3 when one cannot be judged.
    """
    from bags.runs.history_check import check_histories  # noqa: PLC0415 (heavy)
    from dgu_sim.grid import Link  # noqa: PLC0415 (heavy)

    options: dict[str, object] = {
        "unknown_inputs": unknown_inputs,
        "received_std": _deviations(received_std),
        "window": window,
    }
    found = check_histories(bag, history, None if link is None else Link.parse(link), options)
    if json:
        typer.echo(json_module.dumps([one.document(every) for one in found]))
    else:
        for one in found:
            since = "" if one.first_sec is None else f" ({one.first_sec:.3f} s)"
            typer.echo(f"link {one.link}{since}: {one.found.verdict}")
            told = [f"{part.start_sec:g} s {part.misfit:.2g}" for part in one.over_time(every)]
            typer.echo(f"    misfit over what is allowed: {', '.join(told) or 'nothing to judge'}")
    if any(one.found.fits is False for one in found):
        raise typer.Exit(_EXIT_UNFIT)
    if any(one.found.fits is None for one in found):
        raise typer.Exit(EXIT_LEFT_OUT)


@app.command()
def draft(
    source: Source,
    *,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="mapping file to write; default: the terminal")
    ] = None,
    definitions: Definitions = None,
) -> None:
    """Draft a mapping file: candidates with rates and units, and what is missing.

    Exit code 3 when a topic with messages cannot be read.
    """
    from bags.foreign.draft import draft_mapping, missing_of  # noqa: PLC0415 (heavy)
    from bags.foreign.outline import describe_source  # noqa: PLC0415 (heavy)

    found = describe_source(source, known_definitions(definitions))
    text = draft_mapping(source, found)
    if out is None:
        typer.echo(text, nl=False)
    elif out.exists():
        raise CommandError(f"{out}: exists already, expected the path of a file to be made")
    else:
        out.write_text(text, encoding="utf-8")
        typer.echo(f"{out} is written; only you can say:")
        for line in missing_of(found):
            typer.echo(f"    {line}")
    if found.left_out:
        raise typer.Exit(EXIT_LEFT_OUT)


@app.command()
def example(
    folder: Annotated[Path, typer.Argument(help="folder to write to; new or empty", show_default=False)],
) -> None:
    """Write the worked example of docs/import.md: a laboratory's bag, a field bag with an attack, a mapping file."""
    from dcmg.hardware.bags import FIELD, LAB, write_field_bag, write_lab_bag  # noqa: PLC0415 (heavy)

    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise CommandError(f"{folder}: expected a new or empty folder, found one that holds something")
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(str(resources.files("dcmg") / "hardware" / "mapping.yaml"), folder / "mapping.yaml")
    write_lab_bag(folder / LAB)
    write_field_bag(folder / FIELD)
    typer.echo(f"{LAB} (MCAP), {FIELD} (sqlite3) and mapping.yaml are in {folder}")


def _only_link(mapping: Path | None) -> str | None:
    """The link of a mapping that maps one stream."""
    from bags.foreign.mapping import load_data  # noqa: PLC0415 (heavy)

    streams = None if mapping is None else load_data(mapping).get("streams")
    if isinstance(streams, list) and len(streams) == 1 and isinstance(streams[0], dict) and "link" in streams[0]:
        return str(streams[0]["link"])
    raise CommandError("--link: expected the falsified link beside --attack")


def _deviations(text: str) -> float | tuple[float, ...]:
    """Standard deviations, one or one an output."""
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        raise CommandError(f"--received-std {text}: expected numbers, as in 0.001,0.001,0.0001") from None
    return numbers[0] if len(numbers) == 1 else numbers


def _ordered(kind: str, link: str, words: Sequence[str], start: float, stop: float | None) -> dict[str, object]:
    """An attack of the command line as an entry of a mapping."""
    from dcmg.attack_words import parse_order  # noqa: PLC0415 (heavy)

    order = parse_order([kind, link, *words])
    times: dict[str, object] = {"start_sec": start, **_given({"stop_sec": stop})}
    links = [str(one) for one in order.links]
    where: dict[str, object] = {"link": links[0]} if len(links) == 1 else {"links": links}
    return {"kind": kind, **where, **times, **order.parameters}


def _changes(
    *,
    time: str | None,
    period: float | None,
    stamps: Stamps | None,
    policy: Policy | None,
    tolerance: float | None,
    max_gap: float | None,
) -> dict[str, Any]:
    """Keys of a mapping that the options set."""
    top = {"time": time, "sampling_period_sec": period, "stamps": stamps and stamps.value}
    sampling = {"policy": policy and policy.value, "tolerance": tolerance, "max_gap_sec": max_gap}
    return {**_given(top), "sampling": _given(sampling)}


def _mapping(
    file: Path | None, section: str, entry: dict[str, Any], *, needed: Sequence[str], changes: dict[str, Any]
) -> Mapping:
    """The mapping file, or the one that the options describe, with the options' changes."""
    from bags.foreign.mapping import load_data, mapping_of  # noqa: PLC0415 (heavy)

    given = _given(entry)
    if file is None:
        for name in needed:
            if name not in given:
                raise CommandError(f"--{name}: expected it, or a --mapping that says what is what")
        data: dict[str, Any] = {section: [given]}
    elif given:
        raise CommandError(f"--{next(iter(given))}: expected either this or --mapping {file}, found both")
    else:
        data = load_data(file)
    sampling = data.get("sampling", {})
    merged = {**sampling, **changes.pop("sampling")} if isinstance(sampling, dict) else sampling
    return mapping_of({**data, **changes, "sampling": merged}, str(file or _COMMAND_LINE))


def _given(options: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in options.items() if value is not None}


def _with_progress(job: Callable[[Callable[[str, int, int], None]], ImportReport]) -> ImportReport:
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        tasks: dict[str, TaskID] = {}

        def progress(what: str, done: int, total: int) -> None:
            if what not in tasks:
                tasks[what] = bar.add_task(what)
            bar.update(tasks[what], completed=done, total=total)

        return job(progress)


def _tell(report: ImportReport, result: str, *, json: bool) -> None:
    if json:
        typer.echo(json_module.dumps(report.document()))
        return
    for line in report.sentences():
        typer.echo(line)
    typer.echo(result)


def _show_topic(one: Described) -> None:
    count = "an unknown number of rows" if one.messages < 0 else f"{one.messages} messages"
    typer.echo(f"{one.name}  {one.type_name}, {count}")
    if one.unreadable:
        typer.echo(f"    cannot be read: {one.unreadable}")
        return
    for line in one.regularity.sentences()[:6] if one.regularity else ():
        typer.echo(f"    {line.partition(': ')[2]}")
    if one.clock.startswith("recorded,"):
        typer.echo(f"    clock: {one.clock}")
    for what, names in (("numbers", one.fields), ("times", one.times), ("texts", one.texts)):
        if names:
            typer.echo(f"    {what}: {' '.join(names)}")
    if one.units:
        typer.echo(f"    units: {', '.join(f'{name} [{unit}]' for name, unit in one.units)}")
