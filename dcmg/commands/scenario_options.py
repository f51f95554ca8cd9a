"""The options of every command that takes a scenario, and what they mean."""

from __future__ import annotations

import datetime as dt
import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from dcmg.errors import CommandError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dgu_sim.scenario import Scenario as LoadedScenario

Scenario = Annotated[str, typer.Argument(help="name of a shipped scenario (see `dcmg scenarios`) or path of a file")]
Out = Annotated[
    Path | None, typer.Option(help="folder to write to; default: out/SCENARIO-DATE-TIME", show_default=False)
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
Designs = Annotated[
    Path | None,
    typer.Option(
        metavar="BAG",
        help="take the monitors' designs from the bag of another run where they fit: the same bits on every processor",
        show_default=False,
    ),
]
Anyway = Annotated[bool, typer.Option("--anyway", help="take values that no DC microgrid has, and bags of any size")]
Plots = Annotated[bool, typer.Option(help="draw states and residuals as PNG files")]

# compressed bytes of a bag, as of gallo_six_dgu with noise: enough for a warning
_STEP_BYTES, _LINK_BYTES, _WORTH_SAYING = 400, 110, 2e9


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
        anyway: take implausible values too.
    """

    name: str
    duration_sec: float | None
    seed: int | None
    out: Path | None
    overrides: Sequence[str]
    history: Path | None = None
    anyway: bool = False

    @property
    def changes(self) -> list[str]:
        """All that is changed, "a.b=value" each."""
        changes = list(self.overrides)
        if self.duration_sec is not None:
            changes.append(f"duration_sec={self.duration_sec!r}")
        if self.seed is not None:
            changes.append(f"seed={self.seed}")
        if self.history is not None:
            changes.append(f"history.bag={json.dumps(str(self.history.resolve()))}")
        return changes

    def load(self) -> LoadedScenario:
        """Read and check the scenario.

        Raises:
            ScenarioError: it is not valid.
            CommandError: it is implausible, and that is not wanted.
        """
        from bags.watch.scenarios import concerns, load_scenario  # noqa: PLC0415 (heavy)
        from dcmg.commands.showing import messages  # noqa: PLC0415 (heavy)
        from dcmg.shipped import scenario_path  # noqa: PLC0415 (heavy)
        from dgu_sim.scenario_file import raised_by  # noqa: PLC0415 (heavy)

        scenario = load_scenario(scenario_path(self.name), self.changes)
        for one in concerns(scenario):
            if one.implausible and not self.anyway:
                blamed = raised_by(one.key, self.changes, self.name)
                raise CommandError(f"{blamed}: {one.text}; --anyway takes it")
            messages.print(f"[yellow]note[/]: {escape(one.text)}", soft_wrap=True, highlight=False)
        return scenario

    def check_size(self, scenario: LoadedScenario, folder: Path) -> None:
        """Say how large the bag of a long run gets.

        Raises:
            CommandError: there is no room for it.
        """
        from dcmg.commands.showing import messages  # noqa: PLC0415 (heavy)

        size = scenario.steps * (_STEP_BYTES + _LINK_BYTES * len(scenario.links))
        if size < _WORTH_SAYING:
            return
        there = next(one for one in (folder.absolute(), *folder.absolute().parents) if one.exists())
        free = shutil.disk_usage(there).free
        told = f"{scenario.steps} steps of {len(scenario.links)} links: about {size / 1e9:.2g} GB"
        if size > free and not self.anyway:
            raise CommandError(f"{told}, and {there} has room for {free / 1e9:.2g} GB; --anyway tries")
        messages.print(f"[yellow]note[/]: {told}", soft_wrap=True, highlight=False)

    def folder(self, scenario: LoadedScenario) -> Path:
        """Return the folder to write to, which does not hold anything yet.

        Raises:
            CommandError: the wanted folder holds something.
        """
        if self.out is None and Path(scenario.name).name != scenario.name:
            raise CommandError(f"name = {scenario.name!r}: expected one that a folder can have, or another --out")
        now = dt.datetime.now(tz=dt.UTC).astimezone()
        out = self.out or Path("out") / f"{scenario.name}-{now:%Y%m%d-%H%M%S}"
        if out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise CommandError(f"--out {out}: expected a new or empty folder, found one that holds something")
        return out
