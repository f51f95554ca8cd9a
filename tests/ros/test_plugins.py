"""A user's installed package in a run over ROS: node processes know its kinds, forked or started by hand."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from bags.runs.reader import open_run
from bags.wire.plugins import KEY
from tests.ros.conftest import DCMG

if TYPE_CHECKING:
    from collections.abc import Callable

WOBBLE = Path(__file__).parents[1] / "plugins/dcmg_wobble"
CHANGES = (
    "attacks=[{kind: wobble, link: 1-2, start_sec: 1, voltage_v: 0.5}]",
    "monitor.detector={kind: jump, options: {jump: 0.01}}",
    "monitor.observer={kind: brisk}",
)
_SET = [word for change in CHANGES for word in ("--set", change)]


@pytest.fixture(autouse=True)
def _installed(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """The sample package is installed where the command looks."""
    source, folder = tmp_path_factory.mktemp("source") / "wobble", tmp_path_factory.mktemp("installed")
    shutil.copytree(WOBBLE, source, ignore=shutil.ignore_patterns("__pycache__"))
    pip = (sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index")
    subprocess.run([*pip, "--target", folder, source], check=True)
    here = os.environ.get("PYTHONPATH")
    monkeypatch.setenv("PYTHONPATH", f"{folder}:{here}" if here else str(folder))


def test_processes_and_a_simulation_give_the_same_bits(
    dcmg: Callable[..., Any], short_scenario: Path, tmp_path: Path
) -> None:
    """Fifteen forked processes attack with the plug-in and judge with it; `dcmg reproduce` finds every bit again."""
    done = dcmg("run", short_scenario, *_SET, "--no-plots", "--json", "--out", tmp_path / "run")
    assert done.code == 0, done.err
    (attack,) = json.loads(done.out)["attacks"]
    assert (attack["kind"], attack["accused_by"]) == ("wobble", "1-2")
    again = dcmg("reproduce", tmp_path / "run/bag", "--json")
    assert again.code == 0, again.err
    assert json.loads(again.out)["identical"]


def test_an_attack_of_a_plug_in_by_hand_is_named_in_the_bag(
    start_run: Callable[..., Any], dcmg: Callable[..., Any], long_scenario: Path
) -> None:
    """The command and the service know the kind; the bag says which package and version, and is run again."""
    run = start_run(long_scenario, "--pacing", "realtime", "--composed")
    run.wait_until_recording()
    started = dcmg("attack", "start", "wobble", "1-2", "--voltage-v", "0.5", "--anyway", "--domain", run.domain)
    assert started.code == 0, started.err
    refused = dcmg("attack", "start", "wobble", "1-3", "--voltage-v", "-1", "--domain", run.domain)
    assert refused.code == 2
    assert "voltage_v = -1" in refused.err
    assert run.end(signal.SIGINT).code == 0
    recorded = open_run(run.bag)
    assert [event.kind for event in recorded.events] == ["wobble"]
    assert json.loads(recorded.attachments["versions.json"])[KEY] == {"dcmg.attacks/wobble": "dcmg-wobble 0.1.0"}
    again = dcmg("reproduce", run.bag, "--json")
    assert again.code == 0, again.err
    assert json.loads(again.out)["identical"]


def test_nodes_started_by_hand_know_the_plug_in(free_domain: int, dcmg: Callable[..., Any], tmp_path: Path) -> None:
    """Two processes of `dcmg node`, in one of which the attack acts and in the other it is judged."""
    dgus, monitors = [f"dgu_{number}" for number in range(1, 7)], [f"monitor_{number}" for number in range(1, 7)]
    command = (*DCMG, "node", "--scenario", "gallo_six_dgu", "--set", "duration_sec=2.0", *_SET)
    environment = {**os.environ, "ROS_DOMAIN_ID": str(free_domain), "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}
    running = [
        subprocess.Popen([*command, "--out", str(tmp_path), *names], env=environment, stderr=subprocess.PIPE)
        for names in (("clock", "attacker", *dgus), (*monitors, "recorder"))
    ]
    for one in running:
        _, err = one.communicate(timeout=100.0)
        assert one.returncode == 0, err
    assert dcmg("reproduce", tmp_path / "bag").code == 0
