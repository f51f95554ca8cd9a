""".devcontainer sets up what `make` needs, and calls `make`."""

from __future__ import annotations

import json
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_it_installs_what_ci_installs_and_makes_the_environment() -> None:
    """The packages are those that .ci/run installs for a build, and the target is one of the Makefile's."""
    told = json.loads((ROOT / ".devcontainer" / "devcontainer.json").read_text())
    needed = re.search(r"missing\+=\(([^)]*g\+\+[^)]*)\)", (ROOT / ".ci" / "run").read_text())
    assert needed is not None
    assert set(needed[1].split()) <= set(told["onCreateCommand"].split())
    make, target = told["postCreateCommand"].split()
    assert make == "make"
    assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert told["customizations"]["vscode"]["settings"]["python.defaultInterpreterPath"].endswith("/.venv/bin/python")
