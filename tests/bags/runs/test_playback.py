"""What a replay publishes: the messages of a bag in their order, from where and on which topics it was told to."""

from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter

from bags.mcap.errors import BagError
from bags.mcap.recording import TopicFilter
from bags.mcap.typestore import typestore
from bags.runs.playback import Playback, Selection, open_playback
from bags.runs.run_record import RunRecord

_SECOND = 1_000_000_000


def _messages(playback: Playback) -> list[tuple[str, bytes]]:
    return [message for moment in playback.moments() for message in moment.messages]


def _foreign(path: Path, storage: StoragePlugin) -> list[bytes]:
    """A bag of another program: three clock messages, 10 ms apart."""
    store = typestore()
    clock, time = store.types["rosgraph_msgs/msg/Clock"], store.types["builtin_interfaces/msg/Time"]
    found = []
    with RosbagsWriter(path, version=9, storage_plugin=storage) as writer:
        connection = writer.add_connection("/lab/clock", clock.__msgtype__, typestore=store)
        for number in range(3):
            data = store.serialize_cdr(clock(clock=time(sec=number, nanosec=7)), clock.__msgtype__)
            writer.write(connection, number * 10_000_000, data)
            found.append(bytes(data))
    return found


def test_everything_in_the_order_of_the_file(bag: Path, record: RunRecord) -> None:
    """Played without a choice, a bag gives each of its messages, in its order, one moment a step."""
    playback = open_playback(bag, Selection())
    expected = []
    for path in sorted(bag.glob("*.mcap")):
        with path.open("rb") as stream:
            expected += [(one.topic, m.data) for _, one, m in make_reader(stream).iter_messages(log_time_order=False)]
    assert _messages(playback) == expected
    stamps = [moment.time_ns for moment in playback.moments()]
    assert stamps == [record.topics.stamp_ns(step) for step in range(record.steps)]


def test_a_part_of_it(bag: Path, record: RunRecord) -> None:
    """From an offset, what late subscribers would have got comes first; filter, duration and names are obeyed."""
    chosen = TopicFilter(include=("/tick", "/dgu_1/.*"), exclude=(".*/design/.*",))
    selection = Selection(topics=chosen, remap={"/tick": "/lab/tick"}, start_offset_sec=1.0, duration_sec=0.5)
    playback = open_playback(bag, selection)
    first, *later = playback.moments()
    assert first.messages[0][0] == "/dgu_1/history"
    assert playback.topics["/dgu_1/history"].latched
    assert not playback.topics["/tick"].latched
    assert first.time_ns == _SECOND
    assert later[-1].time_ns == _SECOND * 3 // 2
    assert len(later) == round(0.5 / record.sampling_period_sec)
    assert {name for moment in later for name, _ in moment.messages} <= playback.topics.keys()
    assert playback.names["/tick"] == "/lab/tick"
    assert not any("design" in name or name.startswith("/dgu_2") for name in playback.topics)


def test_replaced_messages_come_first(bag: Path) -> None:
    """What replaces a topic's messages is published at the start, and nothing recorded on that topic."""
    name = "/dgu_2/history"
    playback = open_playback(bag, Selection(replaced={name: [b"one", b"two"]}))
    found = _messages(playback)
    assert found[:2] == [(name, b"one"), (name, b"two")]
    assert name not in [one for one, _ in found[2:]]


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_bags_of_other_programs(tmp_path: Path, storage: StoragePlugin) -> None:
    """What `rosbags` writes is played byte for byte, in MCAP and in sqlite3."""
    written = _foreign(tmp_path / "lab", storage)
    playback = open_playback(tmp_path / "lab", Selection())
    assert [data for _, data in _messages(playback)] == written
    assert [moment.time_ns for moment in playback.moments()] == [0, 10_000_000, 20_000_000]
    later = open_playback(tmp_path / "lab", Selection(start_offset_sec=0.005))
    assert [data for _, data in _messages(later)] == written[1:]


def test_files_without_chunks(tmp_path: Path) -> None:
    """An MCAP file whose messages are in no chunk, as rosbag2's preset fastwrite leaves it, is played, too."""
    written = _foreign(tmp_path / "lab", StoragePlugin.MCAP)
    (file,) = (tmp_path / "lab").glob("*.mcap")
    with file.open("wb") as stream:
        writer = Writer(stream, use_chunking=False, compression=CompressionType.NONE)
        writer.start("ros2", "test")
        schema = writer.register_schema("rosgraph_msgs/msg/Clock", "ros2msg", b"builtin_interfaces/Time clock")
        channel = writer.register_channel("/lab/clock", "cdr", schema)
        for number, data in enumerate(written):
            writer.add_message(channel, number * 10_000_000, data, number * 10_000_000)
        writer.finish()  # type: ignore[no-untyped-call] # mcap leaves it without a type
    assert [data for _, data in _messages(open_playback(tmp_path / "lab", Selection()))] == written


def test_a_late_message_goes_out_with_the_later_ones(tmp_path: Path) -> None:
    """A message that was recorded behind later ones stays there: time does not go back."""
    store = typestore()
    clock, time = store.types["rosgraph_msgs/msg/Clock"], store.types["builtin_interfaces/msg/Time"]
    data = bytes(store.serialize_cdr(clock(clock=time(sec=0, nanosec=0)), clock.__msgtype__))
    with RosbagsWriter(tmp_path / "lab", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/lab/clock", clock.__msgtype__, typestore=store)
        for stamp in (10, 30, 20, 40):
            writer.write(connection, stamp, data)
    playback = open_playback(tmp_path / "lab", Selection())
    assert [(one.time_ns, len(one.messages)) for one in playback.moments()] == [(10, 1), (30, 2), (40, 1)]


def test_wrong_choices_are_named(bag: Path, tmp_path: Path) -> None:
    """Nothing to play, a start behind the end, a topic that is not there: one line each."""
    with pytest.raises(BagError, match=r"nothing to play: no message on the topics chosen"):
        open_playback(bag, Selection(topics=TopicFilter(include=("/nothing",))))
    with pytest.raises(BagError, match=r"start offset 9 s, expected at most its 2\.39 s"):
        open_playback(bag, Selection(start_offset_sec=9.0))
    with pytest.raises(BagError, match=r"holds no topic '/dgu_9/output'"):
        open_playback(bag, Selection(remap={"/dgu_9/output": "/lab"}))
    with pytest.raises(BagError, match=r"no such file or folder"):
        open_playback(tmp_path / "nowhere", Selection())


def test_moments_are_ordered_in_time(bag: Path) -> None:
    """Stamps of successive moments increase."""
    stamps = np.array([moment.time_ns for moment in open_playback(bag, Selection()).moments()])
    assert (np.diff(stamps) > 0).all()
