"""Recordings of any origin, held against the library that wrote them."""

import os
import shutil
import sqlite3
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import get_types_from_msg

from bags.mcap.check import check
from bags.mcap.definitions import types_in_folder
from bags.mcap.errors import BagError
from bags.mcap.repair import repair
from bags.mcap.typestore import typestore
from bags.runs.playback import Selection, open_playback
from bags.sources.recorded import Known, open_recorded
from dgu_sim.yaml_limits import YamlLimitError, check_limits

KIND = "geometry_msgs/msg/Vector3"


def _payload(number: float) -> bytes:
    message = typestore().types[KIND](x=number, y=-number, z=0.5)
    return bytes(typestore().serialize_cdr(message, KIND))


def _numbers(path: Path, topic: str, known: Known | None = None) -> list[float]:
    with open_recorded(path, known) as recorded:
        found = []
        for channel, _, data in recorded.messages(recorded.topics[topic]):
            decoder = recorded.decoders[channel]
            assert not isinstance(decoder, str), decoder
            found.append(decoder.read(data).x)
        return found


@settings(max_examples=40, derandomize=True, deadline=None)
@given(
    plugin=st.sampled_from(list(StoragePlugin)),
    mode=st.sampled_from(list(CompressionMode)),
    counts=st.lists(st.integers(0, 40), min_size=1, max_size=3),
    names=st.lists(st.sampled_from(["/a", "b", "/ä/x", "/a.b", "/c-d", "/q?#%"]), min_size=3, max_size=3, unique=True),
    folder=st.sampled_from(["bag", "a#b", "100%", "what?", "ä b"]),
    metadata=st.booleans(),
)
def test_what_rosbags_writes_is_read(  # noqa: PLR0917 - hypothesis gives one argument a kind
    tmp_path_factory: pytest.TempPathFactory,
    plugin: StoragePlugin,
    mode: CompressionMode,
    counts: list[int],
    names: list[str],
    folder: str,
    metadata: bool,  # noqa: FBT001 - idem
) -> None:
    """Storage x compression x topics x names x paths x metadata: every message, bit by bit, also when published."""
    written = tmp_path_factory.mktemp("kind") / "bag"  # what writes it does not take every name
    writer = Writer(written, version=9, storage_plugin=plugin)
    if plugin is StoragePlugin.SQLITE3 and mode is CompressionMode.STORAGE:
        mode = CompressionMode.NONE  # sqlite3 has no such thing
    if mode is not CompressionMode.NONE:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    wanted: dict[str, list[bytes]] = {}
    with writer:
        for name, count in zip(names, counts, strict=False):
            connection = writer.add_connection(name, KIND, typestore=typestore())
            wanted[name] = [_payload(float(number)) for number in range(count)]
            for number, data in enumerate(wanted[name]):
                writer.write(connection, number, data)
    path = written.rename(written.with_name(folder))
    if not metadata:
        (path / "metadata.yaml").unlink()
    with open_recorded(path) as recorded:
        found: dict[str, list[bytes]] = {name: [] for name in recorded.topics}
        for channel, _, data in recorded.messages(recorded.channels):
            found[channel.topic].append(data)
    assert {name: data for name, data in found.items() if data} == {name: data for name, data in wanted.items() if data}
    if any(wanted.values()):
        moments = open_playback(path, Selection()).moments()
        played = [(name, data) for moment in moments for name, data in moment.messages]
        assert sorted(played) == sorted((name, data) for name, all_ in wanted.items() for data in all_)
    if plugin is StoragePlugin.MCAP and mode is CompressionMode.MESSAGE and any(wanted.values()):
        repair(path, path.with_name("repaired"))
        assert check(path.with_name("repaired")).clean
        for name, payloads in wanted.items():
            assert _numbers(path.with_name("repaired"), name) == [float(number) for number in range(len(payloads))]


@settings(max_examples=40, derandomize=True, deadline=None)
@given(
    compression=st.sampled_from(list(CompressionType)),
    chunked=st.booleans(),
    indexed=st.booleans(),
    summary=st.booleans(),
    repeat=st.booleans(),
    count=st.integers(1, 60),
)
def test_what_mcap_writes_is_read(  # noqa: PLR0917 - hypothesis gives one argument a kind
    tmp_path_factory: pytest.TempPathFactory,
    compression: CompressionType,
    chunked: bool,  # noqa: FBT001 - idem
    indexed: bool,  # noqa: FBT001 - idem
    summary: bool,  # noqa: FBT001 - idem
    repeat: bool,  # noqa: FBT001 - idem
    count: int,
) -> None:
    """Chunks x index x summary x repeated definitions, two definitions of one type: each message by its own."""
    file = tmp_path_factory.mktemp("kind") / "x.mcap"
    with file.open("wb") as stream:
        writer = McapWriter(
            stream,
            chunk_size=500,
            compression=compression,
            use_chunking=chunked,
            index_types=IndexType.ALL if indexed else IndexType.NONE,
            repeat_channels=repeat,
            repeat_schemas=repeat,
            use_statistics=summary,
        )
        writer.start("ros2", "test")
        channels = []
        for name, text in (("/a", "float64 x\nfloat64 y\nfloat64 z\n"), ("/b", "float64 y\nfloat64 x\nfloat64 z\n")):
            schema = writer.register_schema(KIND, "ros2msg", text.encode())
            channels.append(writer.register_channel(name, "cdr", schema))
        for number in range(count):
            for channel in channels:
                writer.add_message(channel, number, _payload(float(number)), number)
        writer.finish()  # type: ignore[no-untyped-call] # mcap leaves it without a type
    assert _numbers(file, "/a") == [float(number) for number in range(count)]
    assert _numbers(file, "/b") == [-float(number) for number in range(count)]


def test_count_is_held_against_what_is_promised(tmp_path: Path) -> None:
    """One message less than metadata.yaml promises is an error, more is told."""
    with Writer(tmp_path / "bag", version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection("/a", KIND, typestore=typestore())
        for number in range(10):
            writer.write(connection, number, _payload(float(number)))
    (database,) = (tmp_path / "bag").glob("*.db3")
    with sqlite3.connect(database) as found:
        found.execute("DELETE FROM messages WHERE id = 4")
    with pytest.raises(BagError, match=r"holds 9 messages on /a, metadata\.yaml promises 10"):
        _numbers(tmp_path / "bag", "/a")


def test_definitions_from_elsewhere(tmp_path: Path) -> None:
    """A sqlite3 bag without definitions: named without, read with a folder of .msg files."""
    text = "float64 x\nfloat64 w\n"
    (tmp_path / "lab_msgs" / "msg").mkdir(parents=True)
    (tmp_path / "lab_msgs" / "msg" / "Own.msg").write_text(text)
    typestore().register(get_types_from_msg(text, "lab_msgs/msg/Own"))
    try:
        message = typestore().types["lab_msgs/msg/Own"](x=3.0, w=4.0)
        with Writer(tmp_path / "bag", version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
            connection = writer.add_connection("/own", "lab_msgs/msg/Own", typestore=typestore())
            writer.write(connection, 0, bytes(typestore().serialize_cdr(message, "lab_msgs/msg/Own")))
    finally:
        for found in (typestore().fielddefs, typestore().types):
            del found["lab_msgs/msg/Own"]
    (database,) = (tmp_path / "bag").glob("*.db3")
    with sqlite3.connect(database) as stored:
        stored.execute("DELETE FROM message_definitions")
        stored.execute("UPDATE topics SET type_description_hash = ''")
    with open_recorded(tmp_path / "bag") as recorded:
        assert "--definitions DIR" in recorded.unreadable("/own")
    assert _numbers(tmp_path / "bag", "/own", Known(types=types_in_folder(tmp_path))) == [3.0]


def test_what_is_no_recording_is_called_what_it_is(tmp_path: Path) -> None:
    """Pointers, empty files, pipes, files outside the folder: one line each, and nothing waits."""
    (tmp_path / "lfs.mcap").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n")
    (tmp_path / "empty.mcap").write_bytes(b"")
    os.mkfifo(tmp_path / "pipe.mcap")
    for name, what in (("lfs", "Git LFS pointer"), ("empty", "empty file"), ("pipe", "no regular file")):
        for job in (lambda file: _numbers(file, "/a"), check):
            with pytest.raises(BagError, match=what):
                job(tmp_path / f"{name}.mcap")
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/a", KIND, typestore=typestore())
        writer.write(connection, 0, _payload(1.0))
    shutil.copytree(tmp_path / "bag", tmp_path / "other")
    text = (tmp_path / "bag" / "metadata.yaml").read_text()
    (tmp_path / "bag" / "metadata.yaml").write_text(text.replace("- bag.mcap", "- ../other/bag.mcap"))
    with pytest.raises(BagError, match="expected a file in the same folder"):
        _numbers(tmp_path / "bag", "/a")


def test_yaml_may_not_ask_for_everything() -> None:
    """Aliases count as what they stand for; depth and size are bounded; plain documents pass."""
    bomb = "a: &a [1, 1, 1, 1, 1, 1, 1, 1]\n" + "".join(
        f"{chr(98 + one)}: &{chr(98 + one)} [{', '.join([f'*{chr(97 + one)}'] * 8)}]\n" for one in range(9)
    )
    for text in (bomb, "[" * 100_000, "- " * 100_000, "x" * 20_000_000):
        with pytest.raises(YamlLimitError):
            check_limits(text)
    check_limits(yaml.safe_dump({"a": [{"b": number} for number in range(1000)]}))
