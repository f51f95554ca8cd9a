"""Runs read back as arrays, and bags that cannot be."""

import re
import shutil
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.highlevel import AnyReader

from bags.mcap.errors import BagError
from bags.mcap.topic import Topic, TopicKind
from bags.mcap.writer import BagWriter
from bags.runs.reader import open_run, read_run
from bags.runs.run_record import RunRecord
from bags.watch.scenarios import parse_scenario
from bags.wire.schema import RunTopics
from dgu_sim.grid import Link
from dgu_sim.relay import Action
from dgu_sim.scenario import Scenario

STATE = ("x", "load_current", "reference", "alpha")
CONCLUSIONS = ("phase", "alarm", "estimate", "residual", "threshold")


def test_arrays_hold_what_rosbags_reads(bag: Path, record: RunRecord) -> None:
    """Bulk decoding gives every field the bits that rosbags finds message by message."""
    topics = record.topics
    where: dict[str, tuple[dict[str, str], int]] = {}
    for position, dgu in enumerate(topics.dgus):
        where[topics.state(dgu).topic.name] = ({name: name for name in STATE}, position)
        where[topics.output(dgu).topic.name] = ({"y": "y"}, position)
    for position, link in enumerate(topics.links):
        where[topics.received(link).topic.name] = ({"received": "y", "delivered": "delivered"}, position)
        where[topics.residual(link).topic.name] = ({name: name for name in CONCLUSIONS}, position)
    compared = 0
    with AnyReader([bag]) as reader:
        for connection, _, data in reader.messages():
            if connection.topic in where:
                message: Any = reader.deserialize(data, connection.msgtype)
                fields, position = where[connection.topic]
                for mine, theirs in fields.items():
                    found = getattr(record, mine)[message.step, position]
                    assert found.tobytes() == np.asarray(getattr(message, theirs), dtype=found.dtype).tobytes()
                    compared += 1
    assert compared == record.steps * (3 * 5 + 4 * 7)


def test_documents_of_a_run(record: RunRecord, scenario: Scenario) -> None:
    """Histories, designs, attacks, alarms and the scenario itself come back."""
    assert [(one.dgu, one.experiment) for one in record.histories] == [(1, 0), (2, 0), (3, 0)]
    assert set(record.designs) == set(scenario.links)
    assert [(str(one.link), one.action, one.step) for one in record.events] == [
        ("1-2", Action.START, 100),
        ("1-2", Action.STOP, 150),
        ("3-1", Action.START, 200),
    ]
    assert record.attack_intervals(Link(1, 2)) == ((100, 150),)
    assert record.attack_intervals(Link(3, 1)) == ((200, 240),)
    assert record.attack_intervals(Link(1, 3)) == ()
    assert (record.alarms[0].step, record.alarms[0].source, record.alarms[0].monitor) == (100, 1, 2)
    assert parse_scenario(record.scenario_text) == scenario
    assert (record.steps, record.sampling_period_sec) == (240, 0.01)
    assert record.time_sec[-1] == pytest.approx(2.39)


@settings(max_examples=12, deadline=None)  # every example reads the bag
@given(size=st.integers(1, 300))
def test_windows_are_the_run(bag: Path, record: RunRecord, size: int) -> None:
    """Window by window, whatever their size, a run has the bits and the alarms that it has as a whole."""
    windows = list(open_run(bag).windows(size))
    assert [one.first_step for one in windows] == list(range(0, 240, size))
    assert all(one.steps == size for one in windows[:-1])
    for name in ("x", "load_current", "y", "received", "delivered", *CONCLUSIONS):
        assert np.concatenate([getattr(one, name) for one in windows]).tobytes() == getattr(record, name).tobytes()
    assert repr(tuple(alarm for one in windows for alarm in one.alarms)) == repr(record.alarms)
    assert np.concatenate([one.time_sec for one in windows]).tolist() == record.time_sec.tolist()
    assert windows[-1].attack_intervals(Link(3, 1)) == ((200, 240),)


def _copied(
    bag: Path, folder: Path, topics: RunTopics, keep: Callable[[str, int], bool], extra: tuple[Topic, ...] = ()
) -> Path:
    """A copy of a bag with some of its messages, which `keep(topic, number)` chooses."""
    seen: dict[str, int] = {}
    with BagWriter(folder / "copy", [*topics.all, *extra]) as copy, AnyReader([bag]) as reader:
        for connection, stamp, data in reader.messages():
            number = seen[connection.topic] = seen.get(connection.topic, -1) + 1
            if keep(connection.topic, number):
                copy.write(connection.topic, stamp, bytes(data))
        for topic in extra:
            copy.write(topic.name, 0, b"\0\1\0\0something")
    return folder / "copy"


def test_ragged_last_step_is_left_out(bag: Path, record: RunRecord, topics: RunTopics, tmp_path: Path) -> None:
    """A run that was stopped is read up to the last step of which every message is there."""
    copy = _copied(bag, tmp_path, topics, lambda name, number: number < (120 if name == "/dgu_3/state" else 125))
    early = read_run(copy)
    assert early.steps == 120
    for name in ("x", "y", "received", "residual", "alarm"):
        assert getattr(early, name).tobytes() == getattr(record, name)[:120].tobytes()
    assert [event.step for event in early.events] == [100]


@pytest.mark.parametrize("steps", [0, 1])
def test_run_that_hardly_started(bag: Path, topics: RunTopics, tmp_path: Path, steps: int) -> None:
    """With less than two steps the sampling period comes from the histories."""
    kinds = {topic.name: topic.kind for topic in topics.all}
    copy = _copied(bag, tmp_path, topics, lambda name, number: kinds[name] is TopicKind.LATCHED or number < steps)
    early = read_run(copy)
    assert (early.steps, early.sampling_period_sec) == (steps, 0.01)
    assert early.x.shape == (steps, 3, 3)


def test_other_topics_do_not_disturb(bag: Path, topics: RunTopics, tmp_path: Path) -> None:
    """What somebody else recorded beside a run is left alone."""
    extra = Topic(name="/chatter", type_name="std_msgs/msg/String", publishers=("x",), kind=TopicKind.EVENT)
    assert read_run(_copied(bag, tmp_path, topics, lambda *_: True, (extra,))).steps == 240


def test_foreign_bag_is_named(tmp_path: Path) -> None:
    """A bag of something else is refused with the topics it holds."""
    chatter = Topic(name="/chatter", type_name="std_msgs/msg/String", publishers=("x",), kind=TopicKind.EVENT)
    BagWriter(tmp_path / "bag", [chatter]).close()
    with pytest.raises(BagError, match="found the topics /chatter, expected those of a run"):
        read_run(tmp_path / "bag")


def test_missing_steps_are_named(bag: Path, topics: RunTopics, tmp_path: Path) -> None:
    """A hole in a topic is an error, not a shifted array."""
    copy = _copied(bag, tmp_path, topics, lambda name, number: (name, number) != ("/dgu_2/output", 7))
    with pytest.raises(BagError, match="/dgu_2/output: found step 8, expected step 7"):
        read_run(copy)


def _spoil(bag: Path, folder: Path, spoil: Callable[[bytes], bytes]) -> Path:
    shutil.copytree(bag, folder / "spoilt")
    file = folder / "spoilt" / "run_0.mcap"
    file.write_bytes(spoil(file.read_bytes()))
    return folder / "spoilt"


def test_truncated_bag_says_so(bag: Path, tmp_path: Path) -> None:
    """A file without its end is told apart from other damage, with what can be done."""
    spoilt = _spoil(bag, tmp_path, lambda data: data[: len(data) // 2])
    with pytest.raises(BagError, match=r"breaks off without an MCAP footer, .* `dcmg bag repair"):
        read_run(spoilt)


def test_wrong_statistics_are_named(bag: Path, tmp_path: Path) -> None:
    """A file that holds another number of messages than it says is not read as a shorter run."""
    tick = struct.pack("<HQ", 2, 240)
    wrong = bag.joinpath("run_0.mcap").read_bytes().rsplit(tick, 1)
    unchecked = struct.pack("<HQ", 2, 200).join(wrong)[:-12] + bytes(4) + b"\x89MCAP0\r\n"
    spoilt = _spoil(bag, tmp_path, lambda _: unchecked)
    with pytest.raises(BagError, match="/tick has 240 messages, its statistics promise 200"):
        read_run(spoilt)


@settings(max_examples=60, deadline=None)  # every example copies a file
@given(where=st.floats(0.0, 1.0, exclude_max=True), bit=st.integers(0, 7))
def test_flipped_bits_never_crash(
    bag: Path, record: RunRecord, tmp_path_factory: pytest.TempPathFactory, where: float, bit: int
) -> None:
    """One wrong bit is one line, or it hit something that the numbers do not depend on."""

    def flip(data: bytes) -> bytes:
        at = int(where * len(data))
        return data[:at] + bytes([data[at] ^ 1 << bit]) + data[at + 1 :]

    spoilt = _spoil(bag, tmp_path_factory.mktemp("flipped"), flip)
    found, said = record, ""
    try:
        found = read_run(spoilt)
    except BagError as error:
        said = str(error)
    assert "\n" not in said
    for name in ("x", "y", "received", "residual", "threshold", "alarm"):
        assert getattr(found, name).tobytes() == getattr(record, name).tobytes()
    shutil.rmtree(spoilt)


def _replace_by_file(bag: Path) -> None:
    shutil.rmtree(bag)
    bag.write_text("")


@pytest.mark.parametrize(
    ("prepare", "what"),
    [
        (shutil.rmtree, "does not exist, expected a bag's directory"),
        (_replace_by_file, "is a file, expected a bag's directory"),
        (lambda bag: (bag / "metadata.yaml").unlink(), "metadata.yaml is missing, as when the recorder was killed"),
        (lambda bag: [one.unlink() for one in bag.iterdir()], "holds no metadata.yaml, expected a rosbag2 directory"),
        (lambda bag: (bag / "run_0.mcap").unlink(), "run_0.mcap: is missing, but metadata.yaml names it"),
        (lambda bag: (bag / "run_0.mcap").write_bytes(b""), "breaks off without an MCAP footer"),
        (lambda bag: (bag / "metadata.yaml").write_text("a: [\n"), "cannot be read as YAML"),
        (lambda bag: (bag / "metadata.yaml").write_text("a: 1\n"), "has no rosbag2_bagfile_information"),
    ],
)
def test_what_is_no_bag_is_named(bag: Path, tmp_path: Path, prepare: Callable[[Path], object], what: str) -> None:
    """Everything that is not a closed bag is one line that says what it is instead."""
    copy = tmp_path / "copy"
    shutil.copytree(bag, copy)
    prepare(copy)
    with pytest.raises(BagError, match=re.escape(what)) as error:
        read_run(copy)
    assert "\n" not in str(error.value)
