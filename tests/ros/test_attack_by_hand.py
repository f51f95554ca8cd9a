"""Attacks that a person starts and stops while a realtime run goes on."""

from __future__ import annotations

import json
import re
import signal
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from bags.runs.reader import read_run
from dgu_sim.grid import Link
from dgu_sim.relay import Action

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

BIAS = ("0.1", "-0.2", "0.3")


def test_an_attack_by_hand_is_on_the_wire_and_in_the_bag(
    start_run: Callable[..., Any], dcmg: Callable[..., Any], long_scenario: Path
) -> None:
    """start, list and stop act on the right samples of the right link, and the bag holds both events."""
    run = start_run(long_scenario, "--pacing", "realtime", "--composed")
    run.wait_until_recording()
    here = ("--domain", run.domain)
    started = dcmg("attack", "start", "bias", "1-2", "--bias", *BIAS, "--anyway", *here)
    assert started.code == 0, started.err
    listed = dcmg("attack", "list", "--json", *here)
    assert listed.code == 0, listed.err
    (attack,) = json.loads(listed.out)
    assert [attack[key] for key in ("link", "kind", "active", "origin")] == ["1-2", "bias", True, "service"]
    stopped = dcmg("attack", "stop", "1-2", *here)
    assert stopped.code == 0, stopped.err
    assert run.end(signal.SIGINT).code == 0  # that is how a run in real time ends

    first, last = (int(re.findall(r"step (\d+)", one.out)[0]) for one in (started, stopped))
    assert attack["start_step"] == first
    assert attack["start_sec"] == pytest.approx(first * 0.01, abs=1e-9)
    record = read_run(run.bag)
    assert [(event.action, event.step, event.origin.value) for event in record.events] == [
        (Action.START, first, "service"),
        (Action.STOP, last, "service"),
    ]
    link = record.links.index(Link(1, 2))
    added = record.received[:, link] - record.y[:, 0]
    during = np.arange(record.steps) // 1
    affected = (during >= first) & (during < last)
    np.testing.assert_allclose(added[affected], np.tile([float(one) for one in BIAS], (affected.sum(), 1)), atol=1e-12)
    np.testing.assert_array_equal(added[~affected], 0.0)
    others = [position for position in range(14) if position != link]
    sources = [record.links[position].source - 1 for position in others]
    np.testing.assert_array_equal(record.received[:, others], record.y[:, sources])


def test_wrong_attacks_are_refused_in_one_line(
    start_run: Callable[..., Any], dcmg: Callable[..., Any], long_scenario: Path
) -> None:
    """A link that does not exist, a link that is not one and a stop of nothing each end in one line and exit code 2."""
    run = start_run(long_scenario, "--pacing", "realtime", "--composed")
    run.wait_until_recording()
    for arguments, expected in (
        (("start", "bias", "1-5", "--bias", *BIAS), "link 1-5: expected a communication link"),
        (("start", "covert", "1-2", "4-5", "9-1"), "link 9-1: expected a communication link"),
        (("stop", "1-2"), "link 1-2: no attack is active"),
    ):
        finished = dcmg("attack", *arguments, "--domain", run.domain)
        assert finished.code == 2
        assert expected in finished.err
        assert len(finished.err.strip().splitlines()) == 1
    assert run.end(signal.SIGINT).code == 0  # that is how a run in real time ends
    assert read_run(run.bag).events == ()


def test_without_a_running_system_one_line_says_so(dcmg: Callable[..., Any]) -> None:
    """`dcmg attack` with nothing to attack says what to start, in one line."""
    finished = dcmg("attack", "list", "--domain", "101")
    assert finished.code == 2
    assert finished.err == "dcmg: no attacker answers in ROS domain 101: is a system running there?\n"
