"""`dcmg page`: sit at the grid, in a browser."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dcmg.commands import scenario_options as options
from dcmg.errors import CommandError
from dcmg.joined import joined

if TYPE_CHECKING:
    from dcmg.page.source import Source

Challenged = Annotated[
    str | None,
    typer.Option(
        "--challenge",
        metavar="NAME",
        help="play warm_up, unheard or duel, or one of your own (a file): docs/page.md",
        show_default=False,
    ),
]
Player = Annotated[
    str | None, typer.Option(help="with --challenge: whose score it is; default: your login", show_default=False)
]
Scores = Annotated[
    Path | None,
    typer.Option(help="with --challenge: file of scores; default: dcmg/scores.jsonl of your data", show_default=False),
]
Shown = Annotated[
    str | None,
    typer.Argument(
        metavar="SCENARIO|BAG",
        help="scenario (a shipped name, or a file) to simulate, or a bag to look through",
        show_default=False,
    ),
]
Attach = Annotated[bool, typer.Option("--attach", help="show a run over ROS 2 that goes on already, and attack it")]
Domain = Annotated[
    int | None, typer.Option(help="with --attach: ROS domain id; default: the only one running", show_default=False)
]
Port = Annotated[int, typer.Option(min=0, max=65535, help="port to listen at; 0: any that is free")]
Host = Annotated[
    str, typer.Option(help="address to listen at; any but this machine's own needs the token that is printed")
]
Browser = Annotated[bool, typer.Option("--browser/--no-browser", help="open the page in a browser")]
Rate = Annotated[float, typer.Option(min=0.01, max=1000, help="simulated seconds a second")]
Paused = Annotated[bool, typer.Option("--paused", help="let time stand still until somebody starts it")]


def page(
    shown: Shown = None,
    *,
    attach: Attach = False,
    domain: Domain = None,
    challenge: Challenged = None,
    player: Player = None,
    scores: Scores = None,
    port: Port = 0,
    host: Host = "127.0.0.1",
    browser: Browser = True,
    rate: Rate = 1.0,
    paused: Paused = False,
    duration: options.Duration = None,
    seed: options.Seed = None,
    history: options.History = None,
    designs: options.Designs = None,
    set_: options.Set = None,
    anyway: options.Anyway = False,
) -> None:
    """Sit at the grid: watch it, attack it by hand and see what the monitors notice, in a browser.

    `dcmg page gallo_six_dgu` simulates at the pace of the wall clock, without ROS, until Ctrl-C (or --duration).
    `dcmg page out/demo/bag` shows a recorded run: scrub, play at any speed.
    `dcmg page --attach` (or `dcmg run … --page`) shows the run of `dcmg run`, whose attacker it calls.
    `dcmg page --challenge unheard` is a game: do harm without an alarm.
    The first line on standard output is the address. Needs `pip install 'dcmg[page]'`.
    """
    check_installed()
    if attach:
        if shown is not None:
            raise CommandError(f"{shown}: expected no scenario together with --attach, the run has one")
        joined("page.attach", "dcmg page --attach")(domain, host, port, browser=browser)
        return
    if challenge is not None:
        if shown is not None:
            raise CommandError(f"{shown}: expected no scenario together with --challenge, which has one")
        _play(challenge, player, scores, host, port, browser=browser)
        return
    if shown is None:
        raise CommandError(
            "expected a scenario, a bag, --challenge or --attach (see `dcmg page --help`, `dcmg scenarios`)"
        )
    if domain is not None:
        raise CommandError(f"--domain {domain}: expected only together with --attach")
    from dcmg.page.pace import Pace  # noqa: PLC0415 (heavy)
    from dcmg.page.serving import serve  # noqa: PLC0415 (heavy)

    chosen = options.ScenarioOptions(
        name=shown, duration_sec=duration, seed=seed, out=None, overrides=set_ or [], history=history, anyway=anyway
    )
    source = _bag(chosen, designs) if Path(shown).is_dir() else _simulation(chosen, designs)
    serve(Pace(source, rate, running=not paused), host, port, browser=browser)


def _play(name: str, player: str | None, scores: Path | None, host: str, port: int, *, browser: bool) -> None:
    from getpass import getuser  # noqa: PLC0415 (only here)

    from bags.watch.designs import design_scenario  # noqa: PLC0415 (heavy)
    from bags.watch.scenarios import load_scenario  # noqa: PLC0415 (heavy)
    from dcmg.page.challenge import load_challenge  # noqa: PLC0415 (heavy)
    from dcmg.page.contest import Contest  # noqa: PLC0415 (heavy)
    from dcmg.page.pace import Pace  # noqa: PLC0415 (heavy)
    from dcmg.page.scores import scores_path  # noqa: PLC0415 (heavy)
    from dcmg.page.serving import serve  # noqa: PLC0415 (heavy)
    from dcmg.page.simulated import Simulated  # noqa: PLC0415 (heavy)
    from dcmg.shipped import scenario_path  # noqa: PLC0415 (heavy)

    challenge = load_challenge(name)
    scenario = load_scenario(scenario_path(challenge.scenario), list(challenge.changes))
    designs = design_scenario(scenario)
    contest = Contest(
        challenge,
        Path(name).stem,
        player or getuser(),
        lambda: Simulated(scenario, designs, None),
        scores or scores_path(),
    )
    serve(Pace(contest), host, port, browser=browser)


def check_installed() -> None:
    """See that the server's packages are there; raises CommandError where one is missing."""
    from importlib import util  # noqa: PLC0415 (takes its time)

    for name in ("starlette", "uvicorn", "websockets"):
        if util.find_spec(name) is None:
            raise CommandError(f"the page needs the Python package {name}: pip install 'dcmg[page]'")


def _bag(chosen: options.ScenarioOptions, designs: Path | None) -> Source:
    from dcmg.page.recorded import Recorded  # noqa: PLC0415 (heavy)

    given = {
        "--duration": chosen.duration_sec,
        "--seed": chosen.seed,
        "--history": chosen.history,
        "--designs": designs,
    }
    wrong = [name for name, value in {**given, "--set": chosen.overrides or None}.items() if value is not None]
    if wrong:
        raise CommandError(f"{wrong[0]}: {chosen.name} is a recorded run, expected a scenario with it")
    return Recorded(Path(chosen.name))


def _simulation(chosen: options.ScenarioOptions, designs: Path | None) -> Source:
    from dcmg.commands.checking import check_monitors  # noqa: PLC0415 (heavy)
    from dcmg.page.simulated import Simulated  # noqa: PLC0415 (heavy)

    loaded = chosen.load()
    steps = None if chosen.duration_sec is None else loaded.steps
    return Simulated(loaded, check_monitors(loaded, chosen, designs), steps)
