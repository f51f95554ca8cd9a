"""A run steered by hand can be repeated: from its bag, and as a scenario."""

from __future__ import annotations

import json
import signal
from typing import TYPE_CHECKING, Any

from bags.runs.reader import open_run
from dgu_sim.relay import Action
from tests.ros.conftest import run_dcmg, wait_until

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


def _attack(domain: int, *words: str) -> None:
    """Ask until the detectors have calibrated and the attacker takes it."""
    wait_until(lambda: run_dcmg("attack", *words, "--domain", str(domain)).code == 0)


def test_what_was_done_by_hand_is_done_again(start_run: Callable[..., Any], tmp_path: Path) -> None:
    """Two attacks by hand beside one of the scenario, one of them stopped: the same bytes again, twice."""
    planned = "attacks=[{kind: freeze, link: 5-6, start_sec: 3, stop_sec: 3.5}]"
    run = start_run("gallo_six_dgu", "--pacing", "realtime", "--rate", "4", "--set", planned)
    run.wait_until_recording()
    domain = run.domain
    _attack(domain, "start", "bias", "1-2", "--bias", "0.1", "0.1", "0.1")
    _attack(domain, "start", "bias_random", "3-4", "--spread", "0.05", "0.05", "0.05")
    _attack(domain, "stop", "1-2")
    finished = run.end(signal.SIGINT)
    assert finished.code == 0, finished.err
    events = open_run(run.bag).events
    assert len([one for one in events if one.action is Action.START]) == 3
    again = run_dcmg("reproduce", run.bag, "--json")
    document = json.loads(again.out)
    assert document["differing"] == {}
    assert again.code == 0
    assert document["topics"] > 60
    assert list(document["left_out"]) == ["/attacks/events"]
    told = run_dcmg("script", run.bag, "--out", tmp_path / "steered.yaml")
    assert told.code == 0, told.err
    assert run_dcmg("simulate", tmp_path / "steered.yaml", "--no-plots", "--out", tmp_path / "steered").code == 0
    simulated = open_run(tmp_path / "steered" / "bag")
    assert [(one.step, one.link, one.kind, one.action) for one in simulated.events] == [
        (one.step, one.link, one.kind, one.action) for one in events
    ]
