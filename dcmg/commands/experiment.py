"""`dcmg experiment`: the offline experiments of a scenario's DGUs, as a bag of histories."""

from __future__ import annotations

from typing import Annotated

import typer

from dcmg.commands import scenario_options as options
from dcmg.errors import CommandError


def experiment(
    scenario: options.Scenario,
    *,
    dgu: Annotated[list[int] | None, typer.Option(help="number of a DGU; repeatable; default: all of them")] = None,
    seed: options.Seed = None,
    out: options.Out = None,
    set_: options.Set = None,
) -> None:
    """Run the offline experiment of DGUs and write their histories as a bag, from which monitors are designed."""
    from bags.watch.histories import write_histories  # noqa: PLC0415 (heavy)

    chosen = options.ScenarioOptions(name=scenario, duration_sec=None, seed=seed, out=out, overrides=set_ or [])
    loaded = chosen.load()
    known = [one.id for one in loaded.dgus]
    for number in dgu or []:
        if number not in known:
            raise CommandError(f"--dgu {number}: scenario {loaded.name} has {', '.join(map(str, known))}")
    folder = chosen.folder(loaded)
    folder.mkdir(parents=True, exist_ok=True)
    bag = write_histories(loaded, dgu or known, folder / "history")
    typer.echo(f"histories of DGU {', '.join(map(str, dgu or known))}: {bag}")
