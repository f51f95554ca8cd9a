"""`dcmg report` as a command."""

import json
from pathlib import Path

from typer.testing import CliRunner

from bags.golden import runs
from dcmg.cli import app

GOLDEN = Path(runs.__file__).parent / "biased"


def test_report_of_a_golden_bag(tmp_path: Path) -> None:
    """The command writes page and data, names them, and judges by other monitors when told to."""
    result = CliRunner().invoke(app, ["report", str(GOLDEN), "--out", str(tmp_path / "a")])
    assert result.exit_code == 0, result.output
    assert "bias on 1-2 from 1 s to 1.4 s: after 0.00 s, accused: 1-2" in result.output
    assert (tmp_path / "a" / "report.html").is_file()
    margin = "monitor.detector.options.margin=1e9"
    deaf = CliRunner().invoke(app, ["report", str(GOLDEN), "--out", str(tmp_path / "b"), "--set", margin, "--json"])
    assert deaf.exit_code == 0, deaf.output
    document = json.loads(deaf.stdout)
    assert document["overall"]["residual"]["missed"]["value"] == 1.0
