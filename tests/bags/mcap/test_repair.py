"""Damaged bags: what check says and what repair brings back."""

import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import lz4.frame  # type: ignore[import-untyped] # lz4 ships no types
import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags.highlevel import AnyReader

from bags.mcap.check import check
from bags.mcap.container import open_container
from bags.mcap.errors import BagError
from bags.mcap.expand import expand
from bags.mcap.packing import Compression
from bags.mcap.repair import repair
from bags.mcap.writer import BagWriter
from bags.runs.reader import read_run
from bags.runs.run_record import RunRecord
from bags.wire.schema import RunTopics

Message = tuple[str, int, bytes]


@dataclass(frozen=True, slots=True, kw_only=True)
class Original:
    """A small bag, and where each of its messages stands in the file.

    Attributes:
        folder: The bag.
        data: Its MCAP file.
        messages: Topic, time and bytes in order.
        vital: What nothing else can replace, of the chunk of each message: start of the check sum (four bytes), start
            and end of the data.
    """

    folder: Path
    data: bytes
    messages: list[Message]
    vital: list[tuple[int, int, int]]

    def without(self, at: int) -> list[Message]:
        """What is intact when one bit of one byte is wrong."""
        return [
            one
            for one, (crc, start, end) in zip(self.messages, self.vital, strict=True)
            if not (crc <= at < crc + 4 or start <= at < end)
        ]


def read_mcap(file: Path) -> list[Message]:
    """Every message of a file as the mcap library reads it, check sums verified."""
    with file.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        found = reader.iter_messages(log_time_order=False)
        return [(channel.topic, message.log_time, message.data) for _, channel, message in found]


def make(folder: Path, topics: RunTopics, compression: Compression) -> Original:
    """Record 12 steps of a few topics in chunks of about 1 kB."""
    few = [topics.tick().topic, topics.state(1).topic, topics.received(topics.links[0]).topic]
    rng = np.random.default_rng(3)
    path = folder / f"bag_{compression.name}"
    with BagWriter(path, few, compression=compression, chunk_bytes=1000, max_chunk_age_sec=None) as writer:
        writer.attach("note", b"text")
        layout = writer.format_of(few)
        rows = layout.block(0, 12, topics.sampling_period_ns)
        rows[few[1].name]["x"] = rng.normal(size=(12, 3))
        rows[few[2].name]["y"] = rng.normal(size=(12, 3))
        writer.write_block(layout, rows)
    file = path / f"{path.name}_0.mcap"
    (_, summary), *_ = open_container(path).files
    vital: list[tuple[int, int, int]] = []
    for index, (_, view) in zip(summary.chunks.entries(), open_container(path).chunks(), strict=True):
        start, end = index.start, index.start + index.length
        count = sum(len(offsets) for offsets in view.offsets.values())
        # the check sum stands behind the record's head, two times and the size; the data fill the end
        vital += [(start + 33, end - index.compressed_size, end)] * count
    messages = read_mcap(file)
    assert len(vital) == len(messages) == 36
    return Original(folder=path, data=file.read_bytes(), messages=messages, vital=vital)


@pytest.fixture(scope="module")
def originals(topics: RunTopics, tmp_path_factory: pytest.TempPathFactory) -> list[Original]:
    """One small bag for each compression."""
    folder = tmp_path_factory.mktemp("originals")
    return [make(folder, topics, compression) for compression in Compression]


def spoil(original: Original, folder: Path, data: bytes) -> Path:
    """The bag with other bytes in its file."""
    path = folder / original.folder.name
    shutil.rmtree(path, ignore_errors=True)
    shutil.copytree(original.folder, path)
    (path / f"{path.name}_0.mcap").write_bytes(data)
    return path


def repaired(path: Path, out: Path, *, checked: bool = True) -> tuple[list[Message], int]:
    """What the mcap library reads after a repair, and how many of these messages no check sum vouches for."""
    shutil.rmtree(out, ignore_errors=True)
    report = repair(path, out)
    if checked:
        after = check(out)
        assert after.clean, after.damages
        assert after.messages == report.messages + report.salvaged
    found = read_mcap(out / f"{path.name}_0.mcap")
    assert len(found) == report.messages + report.salvaged
    return found, report.salvaged


def test_thousand_damages(originals: list[Original], tmp_path: Path) -> None:
    """After any truncation or flipped bit, check says so and repair gives back all that is intact and nothing else."""
    rng = random.Random(5)  # noqa: S311 - no secret
    for case in range(1000):
        original = originals[case % 3]
        size = len(original.data)
        if case % 4 == 0:
            cut = rng.randrange(size)
            path = spoil(original, tmp_path, original.data[:cut])
            assert not check(path).clean, cut
            found, salvaged = repaired(path, tmp_path / "out", checked=case % 10 < 2)
            whole = [one for one, (*_, end) in zip(original.messages, original.vital, strict=True) if end <= cut]
            assert found == original.messages[: len(found)], (original.folder.name, cut)
            assert found[: len(found) - salvaged] == whole, (original.folder.name, cut)
        else:
            at, bit = rng.randrange(size), rng.randrange(8)
            data = original.data[:at] + bytes([original.data[at] ^ 1 << bit]) + original.data[at + 1 :]
            path = spoil(original, tmp_path, data)
            assert not check(path).clean, (original.folder.name, at, bit)
            found, salvaged = repaired(path, tmp_path / "out", checked=case % 10 < 2)
            rest = iter(found)
            missing = [one for one in original.without(at) if one not in rest]
            assert not missing, (original.folder.name, at, bit)
            assert set(found) <= set(original.messages), (original.folder.name, at, bit)
            assert not salvaged


def test_clean_bag(bag: Path, record: RunRecord, tmp_path: Path) -> None:
    """A bag as it was closed is clean, and its repair is a copy that reads back bit by bit."""
    report = check(bag)
    assert (report.clean, report.damages) == (True, ())
    assert report.files[0].attachments == ("scenario.yaml", "versions.json")
    done = repair(bag, tmp_path / "copy")
    assert (done.messages, done.salvaged, done.undescribed) == (report.messages, 0, 0)
    again = read_run(tmp_path / "copy")
    assert again.residual.tobytes() == record.residual.tobytes()
    assert again.attachments == record.attachments
    with AnyReader([tmp_path / "copy"]) as reader:
        assert reader.message_count == report.messages


def test_missing_metadata(bag: Path, record: RunRecord, tmp_path: Path) -> None:
    """A killed recorder leaves no metadata.yaml; repair writes the one that closing would have written."""
    shutil.copytree(bag, tmp_path / "run")
    (tmp_path / "run" / "metadata.yaml").unlink()
    assert [str(one) for one in check(tmp_path / "run").damages] == [
        "metadata.yaml: is missing, as when the recorder was killed before it closed the bag"
    ]
    repair(tmp_path / "run", tmp_path / "out")
    assert (tmp_path / "out" / "metadata.yaml").read_text() == (bag / "metadata.yaml").read_text()
    assert read_run(tmp_path / "out").x.tobytes() == record.x.tobytes()


def test_every_byte_of_metadata_counts(originals: list[Original], tmp_path: Path) -> None:
    """A wrong bit in metadata.yaml is seen wherever it is."""
    path = spoil(originals[0], tmp_path, originals[0].data)
    sound = (path / "metadata.yaml").read_bytes()
    for at in range(0, len(sound), 97):
        (path / "metadata.yaml").write_bytes(sound[:at] + bytes([sound[at] ^ 4]) + sound[at + 1 :])
        assert not check(path).clean, at


RECORDER = """
import sys
from pathlib import Path
from bags.wire.schema import run_topics
from bags.mcap.writer import BagWriter
from dgu_sim.grid import Link
topics = run_topics((1, 2), (Link(1, 2),), 10_000_000)
writer = BagWriter(Path(sys.argv[1]), topics.all, chunk_bytes=4000)
for step in range(10**6):
    writer.write("/tick", topics.stamp_ns(step), topics.tick().encode(step))
    if step == 2000:
        print("recording", flush=True)
"""


def test_killed_recorder(tmp_path: Path) -> None:
    """After SIGKILL in the middle of recording, everything up to the open chunk comes back in order."""
    with subprocess.Popen([sys.executable, "-c", RECORDER, str(tmp_path / "bag")], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"recording\n"
        process.kill()
    found, _ = repaired(tmp_path / "bag", tmp_path / "out")
    size = len(found[0][2]) + 31
    assert len(found) > 2000 - 4000 // size - 1
    assert [time // 10_000_000 for _, time, _ in found] == list(range(len(found)))


def test_zeros_of_a_power_failure(originals: list[Original], tmp_path: Path) -> None:
    """Where the file system left zeros instead of the last data, nothing is made up from them."""
    for original in originals:
        for cut in range(len(original.data) // 3, len(original.data), 500):
            path = spoil(original, tmp_path, original.data[:cut] + bytes(4096))
            assert not check(path).clean
            found, _ = repaired(path, tmp_path / "out", checked=False)
            whole = [one for one, (*_, end) in zip(original.messages, original.vital, strict=True) if end <= cut]
            assert found[: len(whole)] == whole == original.messages[: len(whole)]
            assert found == original.messages[: len(found)]


@pytest.mark.parametrize("chunked", [True, False])
def test_foreign_file(tmp_path: Path, *, chunked: bool) -> None:
    """A file of the mcap library, with definitions inside its chunks or without chunks, is checked and repaired."""
    file = tmp_path / "foreign.mcap"
    with file.open("wb") as stream:
        writer = Writer(stream, chunk_size=300, use_chunking=chunked)
        writer.start("ros2", "test")
        schema = writer.register_schema("std_msgs/msg/UInt32", "ros2msg", b"uint32 data")
        channel = writer.register_channel("/chatter", "cdr", schema)
        for number in range(50):
            writer.add_message(channel, number, b"\0\1\0\0" + number.to_bytes(4, "little"), number)
        writer.finish()  # type: ignore[no-untyped-call] # mcap leaves it without a type
    original = read_mcap(file)
    assert check(file).clean, check(file).damages
    data = file.read_bytes()
    file.write_bytes(data[: len(data) // 2])
    assert not check(file).clean
    report = repair(file, tmp_path / "out")
    found = read_mcap(tmp_path / "out" / "foreign.mcap")
    assert found == original[: len(found)]
    assert len(found) == report.messages + report.salvaged >= 15


def test_messages_of_another_encoding_do_not_close_the_bag(tmp_path: Path) -> None:
    """Messages that are not CDR are copied as they are; rosbags opens the repaired bag and reads the others."""
    file = tmp_path / "mixed.mcap"
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "test")
        number = writer.register_schema("std_msgs/msg/UInt32", "ros2msg", b"uint32 data")
        topics = {"/number": writer.register_channel("/number", "cdr", number)}
        topics["/thing"] = writer.register_channel("/thing", "json", 0)
        for at in range(5):
            writer.add_message(topics["/number"], at, b"\0\1\0\0" + at.to_bytes(4, "little"), at)
            writer.add_message(topics["/thing"], at, b'{"at": %d}' % at, at)
        writer.finish()  # type: ignore[no-untyped-call] # mcap leaves it without a type
    repair(file, tmp_path / "out")
    assert read_mcap(tmp_path / "out" / "mixed.mcap") == read_mcap(file)
    with AnyReader([tmp_path / "out"]) as reader:
        chosen = [one for one in reader.connections if one.topic == "/number"]
        read = [reader.deserialize(data, one.msgtype) for one, _, data in reader.messages(chosen)]
    assert [getattr(one, "data", None) for one in read] == [0, 1, 2, 3, 4]


@settings(max_examples=60, deadline=None)  # every example writes files
@given(data=st.binary(max_size=400), framed=st.booleans(), at=st.integers(0, 2000))
def test_arbitrary_bytes(originals: list[Original], data: bytes, at: int, *, framed: bool) -> None:
    """Whatever is in the file, check, repair and reader say one line or find only messages that were recorded."""
    original = originals[at % 3]
    with tempfile.TemporaryDirectory() as folder:
        whole = original.data[:at] + data + original.data[at + len(data) :] if framed else b"\x89MCAP0\r\n" + data
        path = spoil(original, Path(folder), whole)
        assert check(path).clean == (whole == original.data)
        repaired(path, Path(folder) / "out")
        with pytest.raises(BagError) as error:
            read_run(path)
        assert "\n" not in str(error.value)


def test_bombs_are_refused() -> None:
    """What expands to more than the limit is not expanded, whatever it says about its size."""
    plain = bytes(4_000_000)
    for compression, data in (("zstd", zstandard.compress(plain)), ("lz4", lz4.frame.compress(plain)), ("", plain)):
        assert expand(compression, data, 4_000_000) == plain
        with pytest.raises(BagError, match="exceeds 3000000 bytes"):
            expand(compression, data, 3_000_000)
        with pytest.raises(BagError, match="breaks off" if compression else "exceeds"):
            expand(compression, data[:-9], 4_000_000 if compression else 3_000_000)
    with pytest.raises(BagError, match="chunk compression 'xz' is unknown"):
        expand("xz", b"")


@pytest.mark.parametrize("work", [check, lambda path: repair(path, path / "out")])
def test_nothing_to_check(tmp_path: Path, work: Callable[[Path], object]) -> None:
    """No bag, or a directory without one, is one line."""
    with pytest.raises(BagError, match="does not exist, expected a bag's directory"):
        work(tmp_path / "nothing")
    with pytest.raises(BagError, match=r"holds no \*.mcap file"):
        work(tmp_path)
    with pytest.raises(BagError, match="exists already"):
        repair(Path(__file__), tmp_path)
