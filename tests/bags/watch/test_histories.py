"""Offline experiments as bags."""

from pathlib import Path

from rosbags.highlevel import AnyReader

from bags.runs.run_record import RunRecord
from bags.watch.histories import write_histories
from bags.watch.scenarios import parse_scenario
from bags.wire.convert import history_records
from bags.wire.schema import RunTopics
from dgu_sim.experiment import run_experiments
from dgu_sim.scenario import Scenario


def test_histories_are_those_of_a_run(scenario: Scenario, topics: RunTopics, record: RunRecord, tmp_path: Path) -> None:
    """The bag of `dcmg experiment` holds, bit for bit, what the monitors of a run with this seed learn from."""
    bag = write_histories(scenario, [1, 3], tmp_path / "history")
    expected = {one.dgu: topics.history(one.dgu).encode(one) for one in record.histories}
    with AnyReader([bag]) as reader:
        found = {connection.topic: bytes(data) for connection, _, data in reader.messages()}
    assert found == {"/dgu_1/history": expected[1], "/dgu_3/history": expected[3]}


def test_several_experiments(scenario: Scenario, topics: RunTopics, tmp_path: Path) -> None:
    """A history of several experiments is several messages that know how many they are."""
    many = parse_scenario(scenario.to_yaml(), overrides=["history.experiments=3"])
    bag = write_histories(many, [2], tmp_path / "history")
    codec = topics.history(2)
    with AnyReader([bag]) as reader:
        records = [codec.decode(bytes(data)) for _, _, data in reader.messages()]
    assert [(one.experiment, one.experiments) for one in records] == [(0, 3), (1, 3), (2, 3)]
    assert [codec.encode(one) for one in records] == [
        codec.encode(one) for one in history_records(2, run_experiments(many, 2))
    ]
