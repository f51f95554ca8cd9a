"""`dcmg measure`: what is claimed of attacks and detectors, measured on the six-DGU grid."""

from __future__ import annotations

from pathlib import Path

import typer
from rich.console import Console

from dcmg.commands.measure_import import measure_import
from dcmg.commands.paper import PaperExperiment, add_command
from dcmg.commands.soak import soak
from dcmg.tabular import tabulate

app = typer.Typer(no_args_is_help=True, help="Measure what is claimed of attacks and detectors.")

_PACKAGE = "dcmg.measures"

MEASURES = {
    "false-alarms": PaperExperiment(
        package=_PACKAGE,
        module="false_alarms",
        title="False alarms of noise_bound and calibrated against their promises, held and joint, three kinds of noise",
    ),
    "impact": PaperExperiment(
        package=_PACKAGE, module="impact", title="What current biases do to the mean voltage, against the formulas"
    ),
    "roc": PaperExperiment(
        package=_PACKAGE,
        module="roc",
        title="Biases on the jointly integrated grid, loads of +-1 A: ROC and its area",
    ),
    "damage": PaperExperiment(
        package=_PACKAGE,
        module="damage",
        title="The largest damage of attacks that leave no residual, under limits of what is plausible",
    ),
    "damage-combined": PaperExperiment(
        package=_PACKAGE, module="damage_combined", title="The same attacks, watched by the combined monitor", seed=1
    ),
}


@app.command("list")
def list_() -> None:
    """List the measurements."""
    rows = [(name, measure.title) for name, measure in MEASURES.items()]
    rows.append(("soak", "A long run over ROS 2: bounded memory, a sound bag, and a replay that is bit-identical"))
    rows.append(("import", "Memory that the import of a long recording of many topics takes"))
    Console().print(tabulate(("measurement", "what it shows"), rows, framed=False))


for _name, _measure in MEASURES.items():
    add_command(app, _name, _measure, Path("out/measure"))

app.command("soak")(soak)
app.command("import")(measure_import)
