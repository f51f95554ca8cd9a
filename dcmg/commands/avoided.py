"""`dcmg avoided`: what a response avoids, and who is accused of what, when."""

from __future__ import annotations

import json as json_module
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from dcmg.tabular import tabulate

if TYPE_CHECKING:
    from rich.table import Table

    from bags.runs.avoided import Avoided
    from dgu_sim.scenario import Scenario
    from monitor.measures import GridImpact

_QUANTITIES = {
    "mean_voltage": "|<V> - <V_ref>| [V]",
    "voltage": "max |V_i - V_ref,i| [V]",
    "sharing": "spread of I_i / I^r_i",
}
_WORDS = {
    "by_residual": "residual",
    "by_plausibility": "input",
    "by_stream": "stream",
    "by_local": "own state",
}


def avoided(
    scenario: Annotated[str, typer.Argument(help="shipped scenario with monitor.response, or path of a file")],
    *,
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="A.B=VALUE", help="change one key of the scenario; repeatable"),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="print the result as one JSON document")] = False,
) -> None:
    """Simulate a scenario with its response and without, and print who was accused and what the attacks did."""
    from bags.runs.avoided import compare_response  # noqa: PLC0415 (heavy)
    from bags.watch.scenarios import load_scenario  # noqa: PLC0415 (heavy)
    from dcmg.shipped import scenario_path  # noqa: PLC0415 (heavy)

    loaded = load_scenario(scenario_path(scenario), overrides or [])
    document = _document(loaded, compare_response(loaded))
    if json:
        typer.echo(json_module.dumps(document))
        return
    console = Console()
    console.print(_accused_table(document))
    console.print(_impact_table(document))


def _document(scenario: Scenario, found: Avoided) -> dict[str, Any]:
    start = min((attack.start_sec for attack in scenario.attacks), default=0.0)
    first = min(round(start / found.sampling_period_sec), scenario.steps - 1)
    return {
        "scenario": scenario.name,
        "attack_start_sec": start if scenario.attacks else None,
        "accused": [
            {
                "link": str(one.link),
                "sec": one.step * found.sampling_period_sec,
                "by": [_WORDS[reason] for reason in one.reasons],
            }
            for one in found.accused
        ],
        "impact": {
            name: {
                "with_response": _largest(found.with_response, name, first),
                "without": _largest(found.without, name, first),
            }
            for name in _QUANTITIES
        },
    }


def _largest(impact: GridImpact, name: str, first: int) -> float:
    """Largest absolute change of a quantity from the last step before the attack on."""
    values = getattr(impact, name)
    return float(abs(values[first:] - values[max(first - 1, 0)]).max())


def _accused_table(document: dict[str, Any]) -> Table:
    start = document["attack_start_sec"]
    title = "no attack" if start is None else f"attack from {start:g} s on"
    rows = [(one["link"], f"{one['sec']:.2f}", ", ".join(one["by"])) for one in document["accused"]]
    headings = ("link", "first accused [s]", "by")
    return tabulate(headings, rows, numbers={headings[1]}, title=f"{document['scenario']}: {title}")


def _impact_table(document: dict[str, Any]) -> Table:
    headings = ("largest change from then on", "with the response", "without")
    changes = {words: document["impact"][name] for name, words in _QUANTITIES.items()}
    rows = [(words, f"{one['with_response']:.2g}", f"{one['without']:.2g}") for words, one in changes.items()]
    return tabulate(headings, rows, numbers=set(headings[1:]), title="impact")
