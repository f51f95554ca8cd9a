"""Attacks on recorded data: labelled, seen by whoever watches, for plants of any width."""

from pathlib import Path

import numpy as np
import yaml
from typer.testing import CliRunner

from bags.reporting.judged import judge
from bags.reporting.pictures import draw
from bags.reporting.timeline import gather
from bags.runs.reader import open_run, read_run
from bags.runs.replay import concluded
from dcmg.commands.imports import app

MAPPING = {
    "time": "t",
    "histories": [{"dgu": 1, "y": ["y"], "u": ["u"]}],
    "streams": [{"link": "1-2", "y": ["y"], "u": ["u"]}],
    "monitor": {
        "observer": {"kind": "full_order", "options": {"unknown_inputs": 0}},
        "detector": {"kind": "fixed", "options": {"settle_sec": 0.1, "calibrate_sec": 0.5, "margin": 3.0}},
    },
}


def _plant(file: Path, seed: int) -> Path:
    """A plant of one state and one output, driven by a known input, measured in steps of a microvolt."""
    drive = np.random.default_rng(seed).uniform(1.0, 3.0, 200)
    y = np.zeros(200)
    for k in range(199):
        y[k + 1] = 0.8 * y[k] + 0.5 * drive[k]
    file.write_text("t,y,u\n" + "".join(f"{k / 100:.2f},{y[k]:.6f},{drive[k]:.6f}\n" for k in range(200)))
    return file


def test_one_output_is_enough(tmp_path: Path) -> None:
    """The mapping's one stream is falsified, labelled, and judged though nobody has watched it; it can be drawn."""
    (tmp_path / "mapping.yaml").write_text(yaml.safe_dump(MAPPING))
    told = ["--mapping", str(tmp_path / "mapping.yaml")]
    bench, field = _plant(tmp_path / "bench.csv", 1), _plant(tmp_path / "field.csv", 2)
    run = CliRunner().invoke
    done = run(app, ["history", str(bench), *told, "--out", str(tmp_path / "history")])
    assert done.exit_code == 0, done.output
    attack = ["--attack", "bias", "--bias", "0.2", "0", "0", "--start", "1.2"]
    done = run(
        app,
        ["stream", str(field), *told, "--history", str(tmp_path / "history"), *attack, "--out", str(tmp_path / "out")],
    )
    assert done.exit_code == 0, done.output
    raw = read_run(tmp_path / "out")
    assert not raw.designs
    clean = np.loadtxt(field, delimiter=",", skiprows=1)[:, 1]
    np.testing.assert_allclose(raw.received[:, 0, 0] - clean, np.where(np.arange(200) >= 120, 0.2, 0.0), atol=1e-9)
    opened = open_run(tmp_path / "out")
    timeline = gather(concluded(opened.windows()), opened.steps)
    judged = judge(timeline)
    (row,) = judged.attacks
    assert row.episode.detected
    assert row.episode.start_sec == 1.2
    assert all(link.monitored and not link.alarms for link in judged.links)
    assert [file.name for file in draw(timeline, judged, tmp_path / "plots")] == ["states.png", "residuals.png"]
