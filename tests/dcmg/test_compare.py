"""`dcmg compare`: runs side by side."""

import json
from pathlib import Path

from typer.testing import CliRunner

from bags.golden import golden_path
from dcmg.cli import app
from dcmg.commands.compare import compare, side_by_side

RUNNER = CliRunner()


def test_two_runs_side_by_side(tmp_path: Path) -> None:
    """A bag and another one's report share a table: what only one has is a dash in the other."""
    report = RUNNER.invoke(app, ["report", str(golden_path("biased")), "--out", str(tmp_path)])
    assert report.exit_code == 0, report.output
    told = RUNNER.invoke(app, ["compare", str(tmp_path), str(golden_path("stealthy")), "--json"])
    assert told.exit_code == 0, told.output
    documents = list(json.loads(told.stdout).values())
    rows = dict(side_by_side(documents))
    assert rows["bias on 1-2 from 1 s"] == ["after 0.00 s", "-"]
    assert rows["uio_stealthy_trajectory on 1-2 from 0.8 s"] == ["-", "missed"]
    assert rows["attacks seen"] == ["2 of 2", "0 of 1"]
    table = RUNNER.invoke(app, ["compare", str(golden_path("biased")), str(golden_path("stealthy"))])
    assert "missed" in table.output


def test_one_run_is_nothing_to_compare() -> None:
    """One run, or a file that is no report, ends in one line."""
    alone = RUNNER.invoke(app, ["compare", str(golden_path("biased"))])
    assert alone.exit_code != 0
    assert "expected two runs or more" in str(alone.exception) + alone.output
    assert compare.__doc__ is not None
