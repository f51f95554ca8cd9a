"""Replayed runs as bags."""

from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from bags.golden import golden_path
from bags.mcap.check import check
from bags.mcap.errors import BagError
from bags.runs.offline import simulate_to_bag
from bags.runs.reader import open_run, read_run
from bags.runs.replay import replay, replay_windows
from bags.runs.replay_bag import write_replayed
from bags.runs.replay_settings import history_messages, replayed_scenario, with_histories
from bags.runs.run_record import RunRecord
from bags.watch.histories import write_histories
from bags.watch.scenarios import load_scenario
from dcmg.shipped import scenario_path
from dgu_sim.scenario import Scenario


def _messages(bag: Path) -> list[tuple[str, int, bytes]]:
    found = []
    for path in sorted(bag.glob("*.mcap")):
        with path.open("rb") as stream:
            found += [
                (one.topic, m.log_time, m.data) for _, one, m in make_reader(stream).iter_messages(log_time_order=False)
            ]
    return found


def _again(bag: Path, path: Path, overrides: tuple[str, ...] = ()) -> Path:
    for _ in write_replayed(path, replay_windows(open_run(bag).windows(77), overrides), {}):
        pass
    return path


def _simulated_again(name: str, folder: Path) -> Path:
    """The run of a golden bag, made on this machine: designs differ in their last bits between processors."""
    record = read_run(golden_path(name))
    return simulate_to_bag(replayed_scenario(record.path, record.scenario_text), folder / "run")


@pytest.mark.parametrize("name", ["biased", "denial_of_service"])
def test_the_same_settings_give_the_same_messages(name: str, tmp_path: Path) -> None:
    """A run replayed with its own settings is written as it was recorded: every message, in its order."""
    bag = _simulated_again(name, tmp_path)
    assert _messages(_again(bag, tmp_path / "again")) == _messages(bag)


def test_all_that_monitors_say(tmp_path: Path) -> None:
    """Verdicts from several tests, a team's estimates and a second publisher are written as they were recorded, too."""
    short = {
        "gallo_six_dgu_combined": ("duration_sec=1.2", "attacks=[]"),
        "team_six_dgu": ("duration_sec=1.2", "attacks=[]"),
        "gallo_six_dgu": (
            "duration_sec=1.2",
            "monitor.detector.options={settle_sec: 0.1, calibrate_sec: 0.3}",
            "attacks=[{kind: spoof, link: 1-2, start_sec: 0.6, stop_sec: 0.9, falsify: {kind: bias, bias: [1, 0, 0]}}]",
        ),
    }
    for name, overrides in short.items():
        bag = simulate_to_bag(load_scenario(scenario_path(name), overrides), tmp_path / name)
        assert _messages(_again(bag, tmp_path / f"{name}_again")) == _messages(bag), name


def test_another_detector(bag: Path, record: RunRecord, tmp_path: Path) -> None:
    """What is read back is what the replay concluded; the rest is the run's, and the bag is clean."""
    overrides = ("monitor.detector.options.margin=1000",)
    path = _again(bag, tmp_path / "deaf", overrides)
    found, expected = read_run(path), replay(record, overrides)
    for name in ("phase", "alarm", "estimate", "residual", "threshold", "x", "received", "alpha"):
        assert getattr(found, name).tobytes() == getattr(expected, name).tobytes()
    assert found.alarms == ()
    assert found.events == record.events
    assert "margin: 1000" in found.scenario_text
    assert check(path).clean


def test_other_histories(scenario: Scenario, bag: Path, record: RunRecord, tmp_path: Path) -> None:
    """The bag holds the histories that its designs come from: replayed again, it gives the same."""
    histories = write_histories(scenario.model_copy(update={"seed": 8}), (1, 2, 3), tmp_path / "histories")
    windows = replay_windows(with_histories(open_run(bag).windows(), histories))
    for _ in write_replayed(tmp_path / "other", windows, history_messages(histories, (1, 2, 3))):
        pass
    found = read_run(tmp_path / "other")
    assert found.residual.tobytes() != record.residual.tobytes()
    assert replay(found).residual.tobytes() == found.residual.tobytes()
    assert not np.array_equal(found.histories[0].x, record.histories[0].x)


def test_what_was_not_recorded_is_named(bag: Path, tmp_path: Path) -> None:
    """Monitors that listen to more than was recorded can be replayed, but make no bag of a run."""
    overrides = ("monitor.local={detector: {options: {settle_sec: 0.1, calibrate_sec: 0.4}}}",)
    with pytest.raises(BagError, match=r"/dgu_1/own was not recorded, expected a message of every step"):
        _again(bag, tmp_path / "more", overrides)
