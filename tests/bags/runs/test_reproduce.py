"""A bag is made again out of itself; what differs is named."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from bags.mcap.errors import BagError
from bags.runs.offline import simulate_to_bag
from bags.runs.reproduce import reproduce, steered
from bags.watch.scenarios import load_scenario
from dcmg.shipped import scenario_path

if TYPE_CHECKING:
    from pathlib import Path

SHORT = ("duration_sec=3.0", "attacks=[{kind: bias, link: 1-2, bias: [0.1, 0.1, 0.1], start_sec: 2.6, stop_sec: 2.9}]")


@pytest.fixture(name="bag", scope="module")
def _bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    scenario = load_scenario(scenario_path("gallo_six_dgu"), SHORT)
    return simulate_to_bag(scenario, tmp_path_factory.mktemp("recorded") / "bag")


def test_a_bag_is_made_again(bag: Path, tmp_path: Path) -> None:
    """Every topic, every byte; its scenario is the one that was run."""
    found = reproduce(str(bag), str(tmp_path / "again"))
    assert found.differing == {}
    assert found.left_out == {}
    assert found.topics > 60
    assert steered(bag).attacks == load_scenario(scenario_path("gallo_six_dgu"), SHORT).attacks


def test_what_differs_is_named(bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another attack than the recorded one: each topic with the first message that differs."""
    later = load_scenario(scenario_path("gallo_six_dgu"), (*SHORT, "attacks.0.start_sec=2.7"))
    monkeypatch.setattr("bags.runs.reproduce._steered", lambda _: later)
    found = reproduce(bag, tmp_path / "again")
    assert found.differing["/dgu_2/received/dgu_1"] == (261, 300, 300)
    assert "/dgu_1/received/dgu_2" not in found.differing or found.differing["/dgu_1/received/dgu_2"][0] > 261
    assert "/tick" not in found.differing
    assert not found.document()["identical"]


def test_what_was_not_said_differs_from_what_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A topic on which the recorded run was silent, such as alarms, counts like any other."""
    calm = load_scenario(scenario_path("gallo_six_dgu"), (SHORT[0], "attacks=[]"))
    quiet = simulate_to_bag(calm, tmp_path / "quiet")
    attacked = load_scenario(scenario_path("gallo_six_dgu"), SHORT)
    monkeypatch.setattr("bags.runs.reproduce._steered", lambda _: attacked)
    found = reproduce(quiet, tmp_path / "again").differing
    assert found["/dgu_2/alarms"][:2] == (1, 0)
    assert found["/attacks/events"] == (1, 0, 2)


def test_a_bag_without_a_scenario_is_refused(tmp_path: Path) -> None:
    """One line."""
    with pytest.raises(BagError, match="nowhere"):
        reproduce(tmp_path / "nowhere", tmp_path / "again")
