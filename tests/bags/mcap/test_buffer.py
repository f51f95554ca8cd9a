"""Recording behind a buffer: disks that are slow, and disks that refuse."""

import os
import threading
from pathlib import Path

import pytest
import yaml

from bags.mcap.bag import open_bag
from bags.mcap.check import check
from bags.mcap.errors import BagError
from bags.mcap.mcap_file import McapFile
from bags.mcap.recording import Buffer, ChunkPreset, Recording, Split, TopicFilter, WhenFull
from bags.mcap.writer import BagWriter, open_recording
from bags.wire.schema import RunTopics

SMALL = 2000  # bytes of a chunk


class Disk:
    """A disk that writes nothing before it is let go."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Stand in the way of every chunk."""
        self.go = threading.Event()
        add_packed = McapFile.add_packed

        def slow(file: McapFile, chunk: object) -> None:
            self.go.wait()
            add_packed(file, chunk)  # type: ignore[arg-type]

        monkeypatch.setattr(McapFile, "add_packed", slow)


def _record(writer: BagWriter, topics: RunTopics, steps: range) -> None:
    tick, clock = topics.tick(), topics.clock()
    for step in steps:
        writer.write(clock.topic.name, topics.stamp_ns(step), clock.encode(step))
        writer.write(tick.topic.name, topics.stamp_ns(step), tick.encode(step))


def test_same_bag_as_without_buffer(tmp_path: Path, topics: RunTopics) -> None:
    """The thread changes nothing in what is written, splits and attachments included."""
    for name, buffer in (("at_once", None), ("behind", Buffer())):
        with BagWriter(
            tmp_path / name / "bag",
            topics.all,
            chunk_bytes=SMALL,
            max_chunk_age_sec=None,
            split=Split(max_bytes=20_000),
            buffer=buffer,
        ) as writer:
            _record(writer, topics, range(1000))
            writer.attach("note", b"text")
            _record(writer, topics, range(1000, 2000))
    one, other = (sorted((tmp_path / name / "bag").iterdir()) for name in ("at_once", "behind"))
    assert [file.name for file in one] == [file.name for file in other]
    assert [file.read_bytes() for file in one] == [file.read_bytes() for file in other]
    assert len(one) > 3


def test_waiting_loses_nothing(tmp_path: Path, topics: RunTopics, monkeypatch: pytest.MonkeyPatch) -> None:
    """When the buffer is full, the writer waits for the disk, and everything is recorded."""
    disk = Disk(monkeypatch)
    writer = BagWriter(
        tmp_path / "bag", topics.all, chunk_bytes=SMALL, max_chunk_age_sec=None, buffer=Buffer(max_bytes=5 * SMALL)
    )
    recording = threading.Thread(target=_record, args=(writer, topics, range(2000)))
    recording.start()
    buffer = writer._buffer
    assert buffer is not None
    with buffer._changed:
        buffer._changed.wait_for(lambda: buffer.full)
    assert recording.is_alive()  # 2,000 steps are many times what the buffer holds
    disk.go.set()
    recording.join()
    writer.close()
    assert writer.dropped == {}
    assert open_bag(tmp_path / "bag").array("/tick").data["step"].tolist() == list(range(2000))


def test_dropping_never_waits_and_says_so(tmp_path: Path, topics: RunTopics, monkeypatch: pytest.MonkeyPatch) -> None:
    """While the disk stands still whole steps are left out, events are not; all is counted, and the bag is valid."""
    disk = Disk(monkeypatch)
    buffer = Buffer(max_bytes=5 * SMALL, when_full=WhenFull.DROP)
    writer = BagWriter(tmp_path / "bag", topics.all, chunk_bytes=SMALL, max_chunk_age_sec=None, buffer=buffer)
    _record(writer, topics, range(2000))
    writer.write("/dgu_2/alarms", topics.stamp_ns(1999), b"event")
    disk.go.set()
    writer.close()
    bag = open_bag(tmp_path / "bag")
    left_out = writer.dropped["/tick"]
    assert 1000 < left_out < 2000
    assert writer.dropped == {"/clock": left_out, "/tick": left_out}
    assert [bag.topics[name].count for name in ("/clock", "/tick", "/dgu_2/alarms")] == [2000 - left_out] * 2 + [1]
    assert check(tmp_path / "bag").clean
    document = yaml.safe_load((tmp_path / "bag/metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert document["custom_data"] == {"dropped_messages": str(2 * left_out)}


def test_a_disk_that_refuses_ends_the_recording(
    tmp_path: Path, topics: RunTopics, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The error of the thread reaches whoever writes, and what is on the disk is a valid bag."""
    writer = BagWriter(tmp_path / "bag", topics.all, chunk_bytes=SMALL, max_chunk_age_sec=None, buffer=Buffer())
    _record(writer, topics, range(100))
    writer.attach("note", b"text")  # waits for what is before it

    def refuse(*_: object) -> None:
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr(McapFile, "add_packed", refuse)
    with pytest.raises(BagError, match=r"No space left on device\); it is closed and valid up to"):
        _record(writer, topics, range(100, 100_000))
    writer.close()
    report = check(tmp_path / "bag")
    assert report.clean
    assert 0 < report.messages <= 200
    with pytest.raises(BagError, match="the bag is closed"):
        _record(writer, topics, range(1))


def test_options_of_a_recording(tmp_path: Path, topics: RunTopics) -> None:
    """A recording leaves out what it is told to, and a buffer must hold something."""
    chosen = Recording(topics=TopicFilter(exclude=("/clock",)), chunks=ChunkPreset.COMPACT)
    with open_recording(tmp_path / "bag", topics.all, chosen) as writer:
        _record(writer, topics, range(10))
    assert "/clock" not in open_bag(tmp_path / "bag").topics
    assert open_bag(tmp_path / "bag").topics["/tick"].count == 10
    with pytest.raises(BagError, match="max_bytes of the buffer is 0, expected a positive number"):
        Buffer(max_bytes=0)


def test_a_topic_announced_late_waits_for_the_disk(
    tmp_path: Path, topics: RunTopics, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A topic that is announced while a chunk is on its way does not get in between its bytes and its index."""
    entered, go, write = threading.Event(), threading.Event(), McapFile._write

    def slow(file: McapFile, data: bytes) -> None:
        if threading.current_thread().name == "bag":
            entered.set()
            go.wait()
        write(file, data)

    monkeypatch.setattr(McapFile, "_write", slow)
    late = topics.alarms(topics.monitors[0]).topic
    first = [topic for topic in topics.all if topic != late]
    with BagWriter(tmp_path / "bag", first, chunk_bytes=SMALL, max_chunk_age_sec=None, buffer=Buffer()) as writer:
        _record(writer, topics, range(100))
        assert entered.wait(timeout=30.0)
        announcing = threading.Thread(target=writer.add_topic, args=(late,))
        announcing.start()
        announcing.join(timeout=0.2)  # enough for one that does not wait
        go.set()
        announcing.join()
    report = check(tmp_path / "bag")
    assert report.clean, report
    assert open_bag(tmp_path / "bag").topics[topics.tick().topic.name].count == 100
