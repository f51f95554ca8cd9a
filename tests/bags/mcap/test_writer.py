"""Bags as others read them, message by message and in blocks."""

import os
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import NonSeekingReader, make_reader
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader

from bags.mcap.errors import BagError
from bags.mcap.packing import Compression
from bags.mcap.typestore import type_hash
from bags.mcap.writer import BagWriter
from bags.wire.schema import RunTopics

EVENT = "/dgu_2/alarms"


def _rows(bag: BagWriter, topics: RunTopics, steps: int) -> tuple[Any, NDArray[np.void]]:
    """A block of steps with numbers in it."""
    layout = bag.format_of(topics.per_step)
    rows = layout.block(0, steps, topics.sampling_period_ns)
    rng = np.random.default_rng(1)
    for topic in topics.per_step:
        for name in ("x", "y", "residual"):
            if name in (rows[topic.name].dtype.names or ()):
                rows[topic.name][name] = rng.normal(size=(steps, 3))
    return layout, rows


def _singly(bag: BagWriter, topics: RunTopics, steps: int, events: set[int]) -> None:
    _, rows = _rows(bag, topics, steps)
    for row in range(steps):
        for topic in topics.per_step:
            bag.write(topic.name, topics.stamp_ns(row), rows[row][topic.name].tobytes())
        if row in events:
            bag.write(EVENT, topics.stamp_ns(row), bytes(range(row)))


def _in_blocks(bag: BagWriter, topics: RunTopics, steps: int, events: set[int]) -> None:
    layout, rows = _rows(bag, topics, steps)
    start = 0
    for row in sorted(events):
        bag.write_block(layout, rows[start : row + 1])
        bag.write(EVENT, topics.stamp_ns(row), bytes(range(row)))
        start = row + 1
    bag.write_block(layout, rows[start:])


def _file(
    folder: Path,
    topics: RunTopics,
    fill: Callable[[BagWriter, RunTopics, int, set[int]], None],
    events: set[int],
    how: Mapping[str, Any],
) -> bytes:
    path = folder / "bag"
    with BagWriter(path, topics.all, max_chunk_age_sec=None, **how) as bag:
        fill(bag, topics, 25, events)
    return (path / "bag_0.mcap").read_bytes() + (path / "metadata.yaml").read_bytes()


@settings(max_examples=15, deadline=None)  # every example writes two files
@given(
    chunk_bytes=st.integers(200, 60_000),
    compression=st.sampled_from(Compression),
    events=st.sets(st.integers(0, 24), max_size=5),
)
def test_blocks_and_single_messages_give_the_same_file(
    topics: RunTopics, chunk_bytes: int, compression: Compression, events: set[int]
) -> None:
    """However messages come, the same messages in the same order are the same bytes on disk."""
    how = {"chunk_bytes": chunk_bytes, "compression": compression}
    with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as other:
        assert _file(Path(one), topics, _singly, events, how) == _file(Path(other), topics, _in_blocks, events, how)


@pytest.mark.parametrize("compression", list(Compression))
def test_mcap_reads_everything(tmp_path: Path, topics: RunTopics, compression: Compression) -> None:
    """The mcap library finds channels, schemas, every message in order with its stamp, and valid check sums."""
    path = tmp_path / "bag"
    with BagWriter(path, topics.all, compression=compression, chunk_bytes=5000) as bag:
        _in_blocks(bag, topics, 25, {3})
        bag.attach("note", b"text")
    with (path / "bag_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        messages = [(channel.topic, message) for _, channel, message in reader.iter_messages()]
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == len(messages) == 25 * len(topics.per_step) + 1
        assert [one.topic for one in summary.channels.values()] == [topic.name for topic in topics.all]
        assert {one.encoding for one in summary.schemas.values()} == {"ros2msg"}
        assert [(one.name, one.data) for one in reader.iter_attachments()] == [("note", b"text")]
        (metadata,) = reader.iter_metadata()
    names = [topic.name for topic in topics.per_step]
    expected = [(name, row) for row in range(25) for name in [*names, *([EVENT] if row == 3 else [])]]
    assert [(name, message.log_time // topics.sampling_period_ns) for name, message in messages] == expected
    assert [message.sequence for name, message in messages if name == "/tick"] == list(range(25))
    assert metadata.name == "rosbag2"
    inner = yaml.safe_load(metadata.metadata["serialized_metadata"])
    assert inner == yaml.safe_load((path / "metadata.yaml").read_text())["rosbag2_bagfile_information"]


def test_rosbags_reads_every_field(bag: Path, topics: RunTopics) -> None:
    """The rosbags library opens a run's bag with its own schemas and deserialises every message of every topic."""
    counts = dict.fromkeys((topic.name for topic in topics.all), 0)
    with AnyReader([bag]) as reader:
        hashes = {connection.topic: connection.digest for connection in reader.connections}
        for connection, stamp, data in reader.messages():
            message: Any = reader.deserialize(data, connection.msgtype)
            counts[connection.topic] += 1
            stamped = message.clock if connection.topic == "/clock" else message.header.stamp
            assert stamped.sec * 1_000_000_000 + stamped.nanosec == stamp
    assert hashes == {topic.name: type_hash(topic.type_name) for topic in topics.all}
    information = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    told = {one["topic_metadata"]["name"]: one["message_count"] for one in information["topics_with_message_count"]}
    assert told == counts
    assert all(counts[topic.name] == 240 for topic in topics.per_step)


def test_metadata_of_rosbag2(bag: Path) -> None:
    """metadata.yaml has the fields of version 9, with QoS as a list and enumerations as words."""
    information = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert (information["version"], information["storage_identifier"]) == (9, "mcap")
    assert information["relative_file_paths"] == ["run_0.mcap"]
    assert information["duration"]["nanoseconds"] == 2_390_000_000
    assert information["starting_time"]["nanoseconds_since_epoch"] == 0
    assert information["files"][0]["message_count"] == information["message_count"]
    assert "&id" not in (bag / "metadata.yaml").read_text()
    by_name = {one["topic_metadata"]["name"]: one["topic_metadata"] for one in information["topics_with_message_count"]}
    (profile,) = by_name["/dgu_1/history"]["offered_qos_profiles"]
    assert (profile["reliability"], profile["durability"], profile["depth"]) == ("reliable", "transient_local", 64)
    assert len(by_name["/diagnostics"]["offered_qos_profiles"]) == 3


def test_existing_path_is_refused(tmp_path: Path, topics: RunTopics) -> None:
    """A bag never overwrites anything."""
    with pytest.raises(BagError, match="exists already, expected the path of a bag to be made"):
        BagWriter(tmp_path, topics.all)


def test_misuse_is_named(tmp_path: Path, topics: RunTopics) -> None:
    """Unknown topics, double announcements and messages after the end are one line each."""
    bag = BagWriter(tmp_path / "bag", topics.all)
    with pytest.raises(BagError, match="message on /nothing, expected an announced topic"):
        bag.write("/nothing", 0, b"")
    with pytest.raises(BagError, match="topic /clock is announced twice"):
        bag.add_topic(topics.clock().topic)
    bag.close()
    bag.close()
    with pytest.raises(BagError, match="the bag is closed"):
        bag.write("/clock", 0, b"")


def test_topic_without_layout_makes_no_block(tmp_path: Path, topics: RunTopics) -> None:
    """Only messages of fixed length fit into blocks."""
    with (
        BagWriter(tmp_path / "bag", topics.all) as bag,
        pytest.raises(BagError, match=r"/dgu_1/history: .* expected a fixed layout"),
    ):
        bag.format_of([topics.history(1).topic])


def test_chunks_are_closed_by_age(tmp_path: Path, topics: RunTopics, monkeypatch: pytest.MonkeyPatch) -> None:
    """A chunk goes to the disk with the first message 0.05 s after its first one, however small it is."""
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    with BagWriter(tmp_path / "bag", topics.all) as bag:
        file = tmp_path / "bag" / "bag_0.mcap"
        start = file.stat().st_size
        for now[0] in (100.0, 100.02, 100.04):
            bag.write("/tick", 0, topics.tick().encode(0))
        assert file.stat().st_size == start
        now[0] = 100.06
        bag.write("/tick", 0, topics.tick().encode(0))
        assert file.stat().st_size > start


def test_killed_recorder_leaves_its_chunks(tmp_path: Path, topics: RunTopics) -> None:
    """What was flushed is on the disk and readable without the end of the file."""
    bag = BagWriter(tmp_path / "bag", topics.all)
    _singly(bag, topics, 10, set())
    bag.flush()
    with (tmp_path / "bag" / "bag_0.mcap").open("rb") as stream:
        found = 0
        try:
            for _ in NonSeekingReader(stream).iter_messages(log_time_order=False):
                found += 1
        except Exception:  # noqa: BLE001 - the library complains about the missing end in several ways
            assert found
    assert found == 10 * len(topics.per_step)
    bag.close()


def test_exception_closes_the_bag(tmp_path: Path, topics: RunTopics) -> None:
    """An error inside the with block leaves a complete bag with what came before it."""

    def fail() -> None:
        with BagWriter(tmp_path / "bag", topics.all) as bag:
            bag.write("/tick", 0, topics.tick().encode(0))
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    with AnyReader([tmp_path / "bag"]) as reader:
        assert reader.message_count == 1


def test_empty_bag_is_a_bag(tmp_path: Path, topics: RunTopics) -> None:
    """A run that ended before its first message leaves topics and no messages."""
    BagWriter(tmp_path / "bag", topics.all).close()
    with AnyReader([tmp_path / "bag"]) as reader:
        assert reader.message_count == 0
        assert len(reader.connections) == len(topics.all)


def test_full_disk_is_one_line(tmp_path: Path, topics: RunTopics, monkeypatch: pytest.MonkeyPatch) -> None:
    """When the disk refuses, the error says which bag and why."""
    bag = BagWriter(tmp_path / "bag", topics.all)

    def refuse(_chunk: object) -> None:
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr(bag._files._file, "add_packed", refuse)
    bag.write("/tick", 0, topics.tick().encode(0))
    with pytest.raises(BagError, match=r"bag: cannot write the bag \(No space left on device\)"):
        bag.flush()
    monkeypatch.undo()
    bag.close()
