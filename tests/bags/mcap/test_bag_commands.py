"""`dcmg bag` as it is typed."""

import json
import shutil
from pathlib import Path

from typer.testing import CliRunner

from dcmg.commands.bag import app


def test_check_and_repair(bag: Path, tmp_path: Path) -> None:
    """A damaged bag is told by words, JSON and exit code, and its repair passes the check."""
    path = tmp_path / "run"
    shutil.copytree(bag, path)
    run = CliRunner().invoke
    sound = run(app, ["check", str(path)])
    assert (sound.exit_code, "the bag is clean" in sound.output) == (0, True)
    file = path / "run_0.mcap"
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    damaged = run(app, ["check", str(path), "--json"])
    document = json.loads(damaged.output)
    assert (damaged.exit_code, document["clean"]) == (1, False)
    assert "damaged: `dcmg bag repair" in run(app, ["check", str(path)]).output
    done = run(app, ["repair", str(path)])
    assert (done.exit_code, "sound chunks are in" in done.output) == (0, True)
    assert run(app, ["check", str(tmp_path / "run_repaired")]).exit_code == 0
    told = json.loads(run(app, ["repair", str(path), "--out", str(tmp_path / "other"), "--json"]).output)
    assert told["messages"] == document["messages"]


def test_info_and_export(bag: Path, tmp_path: Path) -> None:
    """A bag's content is told as table and JSON, and exported to a new folder."""
    run = CliRunner().invoke
    assert "240" in run(app, ["info", str(bag)]).output
    document = json.loads(run(app, ["info", str(bag), "--json"]).output)
    assert (document["duration_sec"], document["attachments"]) == (2.39, ["scenario.yaml", "versions.json"])
    assert document["messages"] == sum(topic["count"] for topic in document["topics"])
    done = run(app, ["export", str(bag), "--out", str(tmp_path / "tables")])
    assert (done.exit_code, (tmp_path / "tables/dgu_1_history.csv").is_file()) == (0, True)
