"""What the golden bags are and how they are made."""

import json
import shutil
from pathlib import Path
from typing import Any

from bags.offline import simulate_to_bag
from bags.reader import read_run
from bags.report import summary
from dgu_sim.scenario import load_scenario

_FOLDER = Path(__file__).parent
_SCENARIO = "three_dgus.yaml"

_ATTACKS = (
    "[{kind: bias, link: 1-2, start_sec: 1.5, stop_sec: 2.0, bias: [0.1, 0.1, 0.1]}, "
    "{kind: bias, link: 3-1, start_sec: 2.5, bias: [0.5, 0.0, 0.0]}]"
)
GOLDEN: dict[str, tuple[str, ...]] = {
    "attack_free": ("name=attack_free",),
    "biased": ("name=biased", f"attacks={_ATTACKS}"),
}
"""Name of each golden bag and how its scenario differs from three_dgus.yaml."""


def golden_path(name: str, folder: Path = _FOLDER) -> Path:
    """The bag of a name; the expected results stand beside it as `<name>.json`."""
    return folder / name


def expected_of(name: str, folder: Path = _FOLDER) -> dict[str, Any]:
    """The expected results: the report of the run, without its path."""
    document: dict[str, Any] = json.loads((folder / f"{name}.json").read_text("utf-8"))
    return document


def record_golden(folder: Path = _FOLDER) -> tuple[Path, ...]:
    """Record all golden bags and their expected results, in place of older ones.

    Args:
        folder: Where to.

    Returns:
        The bags.

    Raises:
        BagError: A bag cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for name, overrides in GOLDEN.items():
        path = golden_path(name, folder)
        shutil.rmtree(path, ignore_errors=True)
        simulate_to_bag(load_scenario(_FOLDER / _SCENARIO, overrides), path)
        document = summary(read_run(path)).document()
        del document["bag"]
        (folder / f"{name}.json").write_text(json.dumps(document, indent=1) + "\n", "utf-8")
    return tuple(golden_path(name, folder) for name in GOLDEN)
