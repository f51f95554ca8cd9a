"""`dcmg import`: options and mapping files, and the example from bag to alarm."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from bags.mcap.errors import BagError
from bags.runs.replay import replay
from bags.watch.histories import read_histories
from dcmg.commands.imports import app
from dcmg.errors import CommandError
from dcmg.hardware.bags import ATTACK_SEC


def _run(*arguments: object) -> str:
    done = CliRunner().invoke(app, [str(one) for one in arguments], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.stdout


@pytest.fixture(name="table")
def _table(tmp_path: Path) -> Path:
    file = tmp_path / "lab.csv"
    rows = [f"{step * 10},{step},{step * 1000}" for step in (0, 1, 2, 5, 6)]
    file.write_text("\n".join(["t_ms,V,mA", *rows]) + "\n")
    return file


def test_options_make_a_history(table: Path, tmp_path: Path) -> None:
    """Columns with factors, a gap that is told, and the same as a mapping file."""
    out = tmp_path / "bag"
    options = ["--y", "V", "--y", "mA*0.001", "--time", "t_ms*0.001", "--dgu", "1"]
    said = _run("history", table, *options, "--out", out)
    assert "gap of 0.03 s after 0.02 s" in said
    assert "sampling period 0.01 s (detected)" in said
    assert "2 of 7 samples are missing or incomplete" in said
    assert f"7 samples in experiments (1 of DGU 1) are in {out}" in said
    mapping = tmp_path / "mapping.yaml"
    mapping.write_text("time: {field: t_ms, unit: ms}\nhistories: [{dgu: 1, y: [V, {field: mA, unit: mA}]}]\n")
    document = json.loads(_run("history", table, "--mapping", mapping, "--out", tmp_path / "other", "--json"))
    assert (document["samples"], document["missing"]) == (7, 2)
    first, second = (read_histories(path, 1)[0] for path in (out, tmp_path / "other"))
    assert first.y.tobytes() == second.y.tobytes()


def test_options_change_a_mapping_file_and_must_say_enough(table: Path, tmp_path: Path) -> None:
    """A sampling option changes the file's section; what contradicts or is missing is one line."""
    mapping = tmp_path / "mapping.yaml"
    mapping.write_text("time: t_ms*0.001\nhistories: [{dgu: 1, y: [V]}]\nsampling: {tolerance: 0.2}\n")
    options = ["--mapping", mapping, "--policy", "linear", "--max-gap", "0.1"]
    document = json.loads(_run("history", table, *options, "--out", tmp_path / "bag", "--json"))
    assert document["missing"] == 0
    for arguments, what in (
        (["--dgu", "1"], "--y: expected it, or a --mapping that says what is what"),
        (["--mapping", mapping, "--y", "V"], "--y: expected either this or --mapping"),
    ):
        with pytest.raises(CommandError, match=what):
            _run("history", table, *arguments, "--out", tmp_path / "none")
    with pytest.raises(BagError, match=r"command line: sampling\.tolerance = 2\.0: expected a number less than 0.5"):
        _run("history", table, "--dgu", "1", "--y", "V", "--tolerance", "2", "--out", tmp_path / "none")
    assert "numbers: t_ms V mA" in _run("inspect", table)


def test_example_from_bag_to_alarm(tmp_path: Path) -> None:
    """The laboratory's bag gives a history, the field bag a stream, and the replay an alarm when the attack begins."""
    folder = tmp_path / "example"
    assert "lab (MCAP), field (sqlite3) and mapping.yaml are in" in _run("example", folder)
    with pytest.raises(CommandError, match="expected a new or empty folder"):
        _run("example", folder)
    topics = json.loads(_run("inspect", folder / "field", "--json"))
    assert [(one["name"], one["type"], one["messages"]) for one in topics] == [
        ("/from_dgu_1/battery", "sensor_msgs/msg/BatteryState", 600),
        ("/from_dgu_1/controller", "geometry_msgs/msg/Vector3Stamped", 600),
    ]
    mapping = ["--mapping", folder / "mapping.yaml"]
    _run("history", folder / "lab", *mapping, "--out", folder / "history")
    (record,) = read_histories(folder / "history", 1)
    assert (record.y.shape, record.d.shape, record.w.shape) == ((500, 3), (500, 2), (500, 4))
    said = _run("stream", folder / "field", *mapping, "--history", folder / "history", "--out", folder / "stream")
    assert "600 samples of 1 link(s)" in said
    found = replay(folder / "stream")
    assert [one.step * found.sampling_period_sec for one in found.alarms if one.active] == [ATTACK_SEC]
