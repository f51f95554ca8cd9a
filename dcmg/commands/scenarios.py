"""`dcmg scenarios`: what can be run by name."""

from __future__ import annotations

import json as json_module
from typing import Annotated

import typer

from dcmg.shipped import shipped_scenarios


def scenarios(
    *, json: Annotated[bool, typer.Option("--json", help="print name, description and file as a JSON document")] = False
) -> None:
    """List the shipped scenarios."""
    from rich.console import Console  # noqa: PLC0415 (takes its time)

    from bags.watch.scenarios import load_scenario  # noqa: PLC0415 (heavy)
    from dcmg.tabular import tabulate  # noqa: PLC0415 (idem)

    found = {name: " ".join(load_scenario(path).description.split()) for name, path in shipped_scenarios().items()}
    if json:
        files = shipped_scenarios()
        document = [{"name": name, "description": text, "file": str(files[name])} for name, text in found.items()]
        typer.echo(json_module.dumps(document))
        return
    Console().print(tabulate(("scenario", "what it is"), found.items(), framed=False))
