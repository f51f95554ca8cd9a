"""Fresh monitors on recorded runs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bags.mcap.errors import BagError
from bags.reporting.judged import judge
from bags.reporting.plain import plain
from bags.reporting.timeline import gather
from bags.runs.reader import open_run
from bags.runs.replay import replay, replay_windows
from bags.runs.replay_settings import history_messages, with_histories
from bags.runs.run_record import RunRecord
from bags.watch.histories import write_histories
from dgu_sim.errors import ScenarioError
from dgu_sim.scenario import Scenario

CONCLUSIONS = ("phase", "alarm", "estimate", "residual", "threshold")


def test_same_settings_give_the_same_bits(bag: Path, record: RunRecord) -> None:
    """A bag is enough to reproduce every conclusion of its run, bit for bit."""
    again = replay(bag)
    for name in CONCLUSIONS:
        assert getattr(again, name).tobytes() == getattr(record, name).tobytes()
    assert again.designs == record.designs
    assert repr(again.alarms) == repr(record.alarms)
    found, expected = (judge(gather([run], run.steps)) for run in (again, record))
    assert plain((found.attacks, found.links)) == plain((expected.attacks, expected.links))


def test_windows_give_the_same_bits(bag: Path, record: RunRecord) -> None:
    """A run replayed in windows, of which only one is in memory, comes out as recorded, alarms included."""
    windows = list(replay_windows(open_run(bag).windows(77)))
    for name in CONCLUSIONS:
        found = np.concatenate([getattr(one, name) for one in windows])
        assert found.tobytes() == getattr(record, name).tobytes()
    assert repr(tuple(alarm for one in windows for alarm in one.alarms)) == repr(record.alarms)
    assert all(one.designs == record.designs for one in windows)


def test_other_detector(record: RunRecord) -> None:
    """A detector that tolerates more raises no alarm on the same residuals, and the new setting is on record."""
    deaf = replay(record, ["monitor.detector.options.margin=1000"])
    assert deaf.residual.tobytes() == record.residual.tobytes()
    assert not deaf.alarm.any()
    assert deaf.alarms == ()
    assert "margin: 1000" in deaf.scenario_text
    assert record.alarm.any()


def test_wrong_settings_are_named(record: RunRecord) -> None:
    """Only the monitors can be changed afterwards, and only to what exists."""
    with pytest.raises(BagError, match=r"override 'seed=3': a replay changes only monitor\.observer and \.detector"):
        replay(record, ["seed=3"])
    with pytest.raises(ScenarioError, match=r"monitor\.nothing"):
        replay(record, ["monitor.nothing=1"])
    with pytest.raises(ScenarioError, match=r"override .*: monitor\.observer\.kind = 'magic': expected one of"):
        replay(record, ["monitor.observer.kind=magic"])


def test_incomplete_bags_are_named(record: RunRecord) -> None:
    """Without its scenario or a history a run cannot be monitored again."""
    with pytest.raises(BagError, match=r"holds no scenario.yaml"):
        replay(replace(record, attachments={}))
    with pytest.raises(BagError, match="holds no history of DGU 2, expected one"):
        replay(replace(record, histories=tuple(one for one in record.histories if one.dgu != 2)))


def test_other_histories(scenario: Scenario, record: RunRecord, tmp_path: Path) -> None:
    """Designed from histories recorded elsewhere, the monitors differ, and the scenario names the other bag."""
    other = scenario.model_copy(update={"seed": 8})
    bag = write_histories(other, (1, 2, 3), tmp_path / "histories")
    (again,) = replay_windows(with_histories([record], bag), redesign=True)
    assert again.designs != record.designs
    assert again.residual.tobytes() != record.residual.tobytes()
    assert str(bag) in again.scenario_text
    told = history_messages(bag, (2,))
    codec = record.topics.history(2)
    assert [codec.decode(data).x.tolist() for data in told[codec.topic.name]] == [
        one.x.tolist() for one in again.histories if one.dgu == 2
    ]
    with pytest.raises(BagError, match="holds nothing on /dgu_2/history"):
        list(replay_windows(with_histories([record], write_histories(other, (1, 3), tmp_path / "too_few"))))
