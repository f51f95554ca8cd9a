"""`dcmg avoided` as a command."""

import json

from typer.testing import CliRunner

from dcmg.cli import app

QUICK = (
    "duration_sec=3.5",
    "monitor.plausibility.limits={settle_sec: 0.5, calibrate_sec: 2.0, range: [0.4, 0.1]}",
    "attacks.0.start_sec=3.0",
    *(f"dgus.{number}.load=[{{kind: constant, current_a: 12.0}}]" for number in range(6)),
)


def test_avoided_prints_accusations_and_impact() -> None:
    """The table and the document name the accused link and what was avoided."""
    options = [part for one in QUICK for part in ("--set", one)]
    table = CliRunner().invoke(app, ["avoided", "gallo_six_dgu_combined", *options])
    assert table.exit_code == 0, table.output
    assert "1-2" in table.output
    finished = CliRunner().invoke(app, ["avoided", "gallo_six_dgu_combined", *options, "--json"])
    document = json.loads(finished.output)
    assert [one["link"] for one in document["accused"]] == ["1-2"]
    for values in document["impact"].values():
        assert values["with_response"] < values["without"]
