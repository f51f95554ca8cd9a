"""What a replay tells the nodes that run on its data."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bags.runs.offline import simulate_to_bag
from bags.runs.playback import Selection, open_playback
from bags.watch.scenarios import load_scenario
from dcmg.shipped import scenario_path
from dcmg_nodes.stand_in import doubled_steps, intervals_of, live_topics
from dcmg_nodes.wiring import Wiring, wiring_of
from dgu_sim.grid import Link

if TYPE_CHECKING:
    from pathlib import Path

    from dgu_sim.scenario import Scenario

_SPOOF = (
    "duration_sec=0.4",
    "monitor.detector.options={settle_sec: 0.0, calibrate_sec: 0.0}",
    "attacks=[{kind: spoof, link: '1-2', start_sec: 0.1, stop_sec: 0.2, falsify: {kind: bias, bias: [1, 0, 0]}}]",
)


@pytest.fixture(scope="module", name="scenario")
def _scenario() -> Scenario:
    return load_scenario(scenario_path("gallo_six_dgu"), _SPOOF)


@pytest.fixture(scope="module", name="wiring")
def _wiring(scenario: Scenario) -> Wiring:
    return wiring_of(scenario)


@given(st.sets(st.integers(0, 60)))
def test_intervals_hold_the_steps(steps: set[int]) -> None:
    """Intervals cover the steps, nothing else, and do not touch."""
    found = intervals_of(sorted(steps))
    assert {step for first, end in found for step in range(first, end)} == steps
    assert all(end < later for (_, end), (later, _) in itertools.pairwise(found))


def test_spoofed_steps_are_found_in_the_bag(scenario: Scenario, wiring: Wiring, tmp_path: Path) -> None:
    """The messages of a second publisher go out on the topic on which they were, and their steps are known before."""
    playback = open_playback(simulate_to_bag(scenario, tmp_path / "run"), Selection())
    assert doubled_steps(wiring, playback) == {Link(1, 2): [(10, 20)]}
    assert playback.names["/dgu_2/received/dgu_1/second_publisher"] == "/dgu_2/received/dgu_1"


def test_a_live_monitor_speaks_for_itself_and_hears_the_bag(wiring: Wiring) -> None:
    """With monitor 2 live, its own topics are not taken from the bag; its histories and received outputs are."""
    held, needed = live_topics(wiring, ["monitor_2"])
    names = {topic.name for topic in held}
    assert {"/dgu_2/residual/dgu_1", "/dgu_2/alarms", "/diagnostics", "/dgu_2/design/dgu_4"} <= names
    assert not any(name.startswith("/dgu_1/") for name in names)
    assert {topic.name for topic in needed} == {
        "/dgu_1/history", "/dgu_4/history", "/dgu_2/received/dgu_1", "/dgu_2/received/dgu_4",
    }  # fmt: skip
