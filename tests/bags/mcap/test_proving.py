"""A killed recorder's file with one wrong bit in front of its chunks, repaired: every reader reads all of it."""

import struct
import tempfile
import zlib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from bags.golden import golden_path
from bags.mcap.check import check
from bags.mcap.container import open_container
from bags.mcap.messages import walk
from bags.mcap.repair import RepairReport, repair
from bags.sources.recorded import open_recorded

_MESSAGES = 200
_NAME = "biased"


@pytest.fixture(scope="module")
def killed() -> tuple[bytes, int]:
    """The definitions of a golden file, a chunk of its first messages, and no more; and where the chunk begins."""
    container = open_container(golden_path(_NAME))
    (_, summary), *_ = container.files
    first = min(one.start for one in summary.chunks.entries())
    content = next(view for _, view in container.chunks()).data.data
    part = bytes(content[: int(walk(bytes(content)).ends[_MESSAGES - 1])])
    fields = struct.pack("<QQQII", 0, 0, len(part), zlib.crc32(part), 0) + struct.pack("<Q", len(part)) + part
    chunk = struct.pack("<BQ", Opcode.CHUNK, len(fields)) + fields
    return (golden_path(_NAME) / f"{_NAME}_0.mcap").read_bytes()[:first] + chunk, first


def _repaired(folder: Path, data: bytes) -> RepairReport:
    (folder / "bag").mkdir()
    (folder / "bag" / "bag_0.mcap").write_bytes(data)
    return repair(folder / "bag", folder / "out")


def _read_by_all(out: Path) -> list[int]:
    """Number of messages that this reader, the mcap library and rosbags read and decode."""
    counts = [0, 0, 0]
    with open_recorded(out) as recorded:
        for channel, _, data in recorded.messages(recorded.channels):
            decoder = recorded.decoders[channel]
            assert not isinstance(decoder, str), decoder
            decoder.read(data)
            counts[0] += 1
    with (out / "bag_0.mcap").open("rb") as stream:
        counts[1] = sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages())
    with AnyReader([out]) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
            counts[2] += 1
    return counts


@settings(max_examples=20, deadline=None, derandomize=True)  # every example writes files
@given(share=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_wrong_bit_in_the_definitions(killed: tuple[bytes, int], share: float, bit: int) -> None:
    """Whatever bit it is, what repair keeps is read by all three readers, and what it leaves out is counted."""
    data, first = killed
    at = 8 + int(share * (first - 8))
    with tempfile.TemporaryDirectory() as folder:
        report = _repaired(Path(folder), data[:at] + bytes([data[at] ^ 1 << bit]) + data[at + 1 :])
        kept = report.messages + report.salvaged
        assert _read_by_all(report.path) == [kept] * 3, (at, bit)
        assert check(report.path).clean, (at, bit)
        assert kept <= _MESSAGES <= kept + report.undescribed, (at, bit)  # a wrong kind makes a message of a channel


@pytest.mark.parametrize(
    ("what", "wrong", "said"),
    [
        (b"RIHS01_", b"RiHS01_", "type hash of"),
        (b"- history: keep_last", b"- {istory: keep_last", "quality of service of"),
        (b"\n  depth: 1000", b"\n \0depth: 1000", "quality of service of"),
    ],
)
def test_what_is_said_beside_the_definition(
    killed: tuple[bytes, int], tmp_path: Path, what: bytes, wrong: bytes, said: str
) -> None:
    """A damaged type hash or quality of service costs no message: it is left out, and told."""
    data, first = killed
    at = data.index(what)
    assert at < first
    report = _repaired(tmp_path, data[:at] + wrong + data[at + len(wrong) :])
    assert report.messages == _MESSAGES
    assert any(said in str(one) for one in report.damages), report.damages
    assert _read_by_all(report.path) == [_MESSAGES] * 3


@pytest.mark.timeout(60)
@pytest.mark.parametrize("opcode", [Opcode.SCHEMA, Opcode.CHANNEL])
def test_two_of_one_number(killed: tuple[bytes, int], tmp_path: Path, opcode: Opcode) -> None:
    """Where a wrong number makes two definitions claim one, neither is believed, and repair comes to an end."""
    data, first = killed
    starts, at = [], 8
    while at < first:
        starts += [at] if data[at] == opcode else []
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")
    number = starts[1] + 9  # the second one takes the number of the third
    wrong = data[:number] + data[starts[2] + 9 : starts[2] + 11] + data[number + 2 :]
    report = _repaired(tmp_path, wrong)
    assert any("have the number 3: neither is believed" in str(one) for one in report.damages)
    assert report.messages + report.undescribed == _MESSAGES
    assert _read_by_all(report.path) == [report.messages] * 3
