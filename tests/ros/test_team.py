"""A team of monitors over ROS: six processes that exchange estimates conclude, bit for bit, what a simulation does."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from mcap.reader import make_reader

from bags.runs.reader import read_run
from bags.watch.scenarios import load_scenario
from dcmg.shipped import scenario_path

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

# Everything that happens to a team, in two seconds: what is told, and what is not, must be the same everywhere.
SHORT = (
    "name=short_team",
    "duration_sec=2.0",
    "monitor.team.settle_sec=0.6",
    "monitor.team.calibrate_sec=0.2",
    "monitor.team.events.0.start_sec=0.5",
    "monitor.team.events.1.start_sec=0.9",
    "monitor.team.events.2.start_sec=1.5",
    "monitor.team.events.2.stop_sec=1.7",
    "monitor.detector.options.calibrate_sec=0.5",
    "attacks=[{kind: drop, link: 1-2, start_sec: 1.8, stop_sec: 1.85}]",
)


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory, dcmg: Callable[..., Any]) -> tuple[Path, Path]:
    """The scenario's file, and its bag made without ROS."""
    folder = tmp_path_factory.mktemp("team")
    scenario = folder / "short_team.yaml"
    scenario.write_text(load_scenario(scenario_path("team_six_dgu"), SHORT).to_yaml())
    finished = dcmg("simulate", scenario, "--no-plots", "--out", folder / "simulated")
    assert finished.code == 0, finished.err
    return scenario, folder / "simulated" / "bag"


@pytest.mark.parametrize("how", [(), ("--composed",)], ids=["processes", "composed"])
def test_members_on_the_wire_tell_what_the_simulated_ones_do(
    simulated: tuple[Path, Path], how: tuple[str, ...], dcmg: Callable[..., Any], tmp_path: Path
) -> None:
    """Every payload of every topic is the same; joins, leaves, lies and lost samples keep nobody waiting."""
    scenario, expected = simulated
    finished = dcmg("run", scenario, *how, "--no-plots", "--out", tmp_path / "run")
    assert finished.code == 0, finished.err
    assert "member 2 of the team accuses member 4" in finished.err + finished.out
    wanted, found = payloads(expected), payloads(tmp_path / "run" / "bag")
    assert {topic: len(data) for topic, data in found.items()} == {t: len(data) for t, data in wanted.items()}
    assert [topic for topic in wanted if found[topic] != wanted[topic]] == []


def test_the_run_shows_what_it_should(simulated: tuple[Path, Path]) -> None:
    """All members estimate, member 2 is away while its samples are lost, and starts again from what others tell."""
    record = read_run(simulated[1])
    assert record.told is not None
    present = record.told.phase == 2
    assert not present[180:185, 1].any()
    assert present[185:, 1].all()
    error = np.abs(record.told.estimate[[179, 199], 1] - record.x[[179, 199]].reshape(2, -1)).max(axis=1)
    assert error[1] < 1.0  # the loads move the grid by amperes while it is away


def payloads(bag: Path) -> dict[str, list[bytes]]:
    """Payload bytes of every topic, in the order of the file."""
    found: dict[str, list[bytes]] = {}
    for path in sorted(bag.glob("*.mcap")):
        with path.open("rb") as stream:
            for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
                found.setdefault(channel.topic, []).append(message.data)
    return found
