"""Monitors on topics of other programs, over ROS: the worked example of docs/import.md, and what can be wrong."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from rosbags.interfaces import Nodetype
from typer.testing import CliRunner

from bags.foreign.fields import FieldPath
from bags.foreign.importing import import_streams
from bags.foreign.mapping import load_mapping
from bags.mcap.check import check
from bags.mcap.errors import BagError
from bags.mcap.typestore import typestore
from bags.runs.reader import read_run
from bags.runs.replay import replay
from bags.watch.histories import write_histories
from bags.watch.scenarios import load_scenario
from dcmg.cli import app
from dcmg.hardware.bags import ATTACK_SEC
from dcmg.shipped import scenario_path
from dcmg_bringup.domain import choose_domain
from dcmg_bringup.ros_environment import ros_environment
from dcmg_nodes.errors import NodeError
from dcmg_nodes.foreign_types import definitions_of_class, foreign_class

if TYPE_CHECKING:
    from collections.abc import Callable

DCMG = (sys.executable, "-m", "dcmg")
ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "import.md").read_text(encoding="utf-8")


def _commands(script: str, environment: dict[str, str]) -> str:
    """Do what the lines of a script say and return what they said; only what needs ROS gets a process."""
    said: list[str] = []
    behind: list[subprocess.Popen[str]] = []
    try:
        for line in script.strip().splitlines():
            words = shlex.split(line)
            if words == ["wait"]:
                said += [_ended(behind.pop())]
            elif words[-1] == "&":
                behind.append(_start([*DCMG, *words[1:-1]], environment))
            elif words[0] == "python":
                said.append(_ended(_start([sys.executable, *words[1:]], environment)))
            else:
                done = CliRunner().invoke(app, words[1:], catch_exceptions=False)
                assert done.exit_code == 0, done.output
                said.append(done.output)
    finally:
        for process in behind:
            process.kill()
    return "".join(said)


def _start(command: list[str], environment: dict[str, str]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command, env={**os.environ, **environment}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


def _ended(process: subprocess.Popen[str]) -> str:
    try:
        said, _ = process.communicate(timeout=150)
    finally:
        process.kill()
    assert process.returncode == 0, said
    return said


def test_worked_example_raises_the_alarm_and_replays_to_the_same_bits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The commands of the page, as they stand there: certificate, live alarm with the attack, and a bag of it."""
    example = PAGE.split("## A worked example")[1]
    script, said, mapping = re.findall(r"```\w*\n(.*?)```", example, flags=re.DOTALL)[:3]
    monkeypatch.chdir(tmp_path)
    with choose_domain() as domain:
        output = _commands(script, ros_environment(domain))
    assert "full_order: accepted: 2 unknown inputs" in output
    assert mapping == Path("example/mapping.yaml").read_text(encoding="utf-8")
    live = read_run(Path("example/live"))
    assert live.steps == 500
    assert live.delivered.all()
    # the first messages may be on their way before the monitor is there: steps count from the first one that came
    heard = load_mapping(Path("example/mapping.yaml"))
    import_streams(Path("example/field"), heard, Path("example/stream"))
    recorded = read_run(Path("example/stream")).received[:, 0]
    (missed,) = [row for row in range(101) if np.array_equal(recorded[row : row + 500], live.received[:, 0])]
    first = next(one for one in live.alarms if one.active)
    assert (first.step + missed) * live.sampling_period_sec == ATTACK_SEC
    assert said.strip().partition(" s ")[2] in output
    again = replay(live)
    assert again.alarms == live.alarms
    for name in ("residual", "threshold", "estimate", "alarm", "phase"):
        np.testing.assert_array_equal(getattr(again, name), getattr(live, name), err_msg=name)


def test_topics_that_nobody_publishes_are_named(tmp_path: Path, dcmg: Callable[..., Any]) -> None:
    """Without the topic the command ends after the wait, in one line that names it, with a valid bag."""
    mapping, history = tmp_path / "mapping.yaml", tmp_path / "history"
    mapping.write_text("streams: [{link: 1-2, y: [/a.x, /a.y, /a.z]}]\n")
    write_histories(load_scenario(scenario_path("isolated_dgu_1")), [1], history)
    with choose_domain() as domain:
        options = ("--history", history, "--wait", "0.5", "--domain", str(domain), "--out", tmp_path / "bag")
        done = dcmg("monitor", mapping, *options)
    assert done.code == 2
    assert done.err.splitlines()[-1] == "dcmg: nobody published /a within 0.5 s, found no topic"
    assert check(tmp_path / "bag").clean


@pytest.mark.parametrize(
    "type_name",
    ["sensor_msgs/msg/BatteryState", "std_msgs/msg/Float64MultiArray", "sensor_msgs/msg/MultiDOFJointState"],
)
def test_installed_types_are_described_as_rosbags_describes_them(type_name: str) -> None:
    """One check of field paths serves bags and live topics: both know the same fields of a type."""
    live, recorded = definitions_of_class(type_name), typestore().fielddefs
    assert set(live) == _used(type_name)
    for name, fields in live.items():
        assert list(fields) == [(field, _plain(description)) for field, description in recorded[name][1]]


def _plain(description: Any) -> Any:  # noqa: ANN401 - of rosbags
    """Strings and sequences without their bounds: no number depends on them."""
    kind, detail = description
    if kind is Nodetype.BASE:
        return kind, (detail[0], 0)
    if kind in {Nodetype.ARRAY, Nodetype.SEQUENCE}:
        return kind, (_plain(detail[0]), detail[1] if kind is Nodetype.ARRAY else 0)
    return kind, detail


def _used(type_name: str) -> set[str]:
    found: set[str] = set()
    wanted = [type_name]
    while wanted:
        name = wanted.pop()
        found.add(name)
        for _, description in typestore().fielddefs[name][1]:
            kind, detail = _plain(description)
            kind, detail = detail[0] if kind in {Nodetype.ARRAY, Nodetype.SEQUENCE} else (kind, detail)
            if kind is Nodetype.NAME and detail not in found:
                wanted.append(detail)
    return found


def test_wrong_fields_and_unknown_types_are_told_live_as_well() -> None:
    """The same one-line errors as for bags, and one that tells what to install."""
    definitions = definitions_of_class("sensor_msgs/msg/BatteryState")
    for text, what in (
        ("/b.volts", "has no field 'volts'"),
        ("/b.location", "is a string, expected a number"),
        ("/b.cell_voltage", r"as in /b.cell_voltage\[0\]"),
    ):
        with pytest.raises(BagError, match=what):
            FieldPath.parse(text).check("sensor_msgs/msg/BatteryState", definitions)
    with pytest.raises(
        NodeError, match="topic /b: message type lab_msgs/msg/Plant is unknown here, expected its package"
    ):
        foreign_class("lab_msgs/msg/Plant", "/b")
