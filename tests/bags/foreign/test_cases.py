"""One small input for each kind that once lost, swapped or misled: x about 48, y about 2, a message every 10 ms."""

import shutil
import sqlite3
import struct
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from mcap.writer import IndexType
from mcap.writer import Writer as McapWriter
from numpy.typing import NDArray
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from bags.foreign.importing import ImportReport, import_histories, import_streams
from bags.foreign.mapping import mapping_of
from bags.foreign.outline import describe_source
from bags.mcap.check import check
from bags.mcap.errors import BagError
from bags.mcap.repair import repair
from bags.mcap.typestore import schema_text, typestore
from bags.runs.playback import Selection, open_playback
from bags.runs.reader import read_run
from bags.watch.histories import read_histories

K = np.arange(100)
X = 48 + np.sin(0.37 * K) + 0.3 * np.sin(1.3 * K)
Y = 2 + 0.5 * np.cos(0.21 * K)
STAMPS_NS = (1000 * 10**9 + K * 10**7).tolist()
MEAS, VECTOR, EVENT = "lab_msgs/msg/Meas", "geometry_msgs/msg/Vector3Stamped", "lab_msgs/srv/Set_Event"
VOLTS_FIRST, AMPERES_FIRST = "float64 v\nfloat64 i\n", "float64 i\nfloat64 v\n"
SERVICE = "SRV: lab_msgs/srv/Set\nfloat64 v\n---\nbool ok\n"
RELIABLE = "- history: 1\n  depth: 10\n  reliability: 1\n  durability: 2\n"


def _numbers(*values: float) -> bytes:
    return b"\0\1\0\0" + struct.pack(f"<{len(values)}d", *values)


def _vector(k: int) -> bytes:
    types = typestore().types
    header = types["std_msgs/msg/Header"](
        types["builtin_interfaces/msg/Time"](*divmod(STAMPS_NS[k], 10**9)), "f" * (k % 5)
    )
    message = types[VECTOR](header, types["geometry_msgs/msg/Vector3"](float(X[k]), float(Y[k]), 0.0))
    return bytes(typestore().serialize_cdr(message, VECTOR))


def _mcap(
    file: Path,
    topics: Sequence[tuple[str, str, str | None, Mapping[int, bytes]]],
    qos: str = "",
    **options: Any,  # noqa: ANN401 - of mcap's writer
) -> Path:
    """Write topics (name, type, definition, message by k) with the mcap library."""
    file.parent.mkdir(exist_ok=True)
    with file.open("wb") as stream:
        writer = McapWriter(stream, **options)
        writer.start("ros2", "test")
        channels = []
        for name, kind, text, _ in topics:
            schema = writer.register_schema(kind, "ros2msg", text.encode()) if text is not None else 0
            channels.append(writer.register_channel(name, "cdr", schema, {"offered_qos_profiles": qos}))
        for k in K.tolist():
            for channel, (*_, messages) in zip(channels, topics, strict=True):
                if k in messages:
                    writer.add_message(channel, STAMPS_NS[k], messages[k], STAMPS_NS[k])
        writer.finish()  # type: ignore[no-untyped-call] # mcap leaves it without a type
    return file


def _metadata(folder: Path, topics: Mapping[str, tuple[str, int]], qos: object = "") -> Path:
    """The metadata.yaml of topics (type, number of messages) and every MCAP file in a folder."""
    entries = [
        {
            "topic_metadata": {
                "name": name,
                "type": kind,
                "serialization_format": "cdr",
                "offered_qos_profiles": qos,
                "type_description_hash": "",
            },
            "message_count": count,
        }
        for name, (kind, count) in topics.items()
    ]
    information = {
        "version": 9,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": STAMPS_NS[-1] - STAMPS_NS[0]},
        "starting_time": {"nanoseconds_since_epoch": STAMPS_NS[0]},
        "message_count": sum(count for _, count in topics.values()),
        "topics_with_message_count": entries,
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": sorted(one.name for one in folder.glob("*.mcap")),
    }
    (folder / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": information}))
    return folder


VECTORS = {k: _vector(k) for k in K.tolist()}
WHOLE = {"/a": (VECTOR, len(K))}


def _qos_differs(folder: Path) -> Path:
    for part, ks in enumerate((range(50), range(50, 100))):
        _mcap(folder / f"r_{part}.mcap", [("/a", VECTOR, schema_text(VECTOR), {k: VECTORS[k] for k in ks})], RELIABLE)
    return _metadata(folder, WHOLE, [{"history": "keep_last", "depth": 0, "reliability": "best_effort"}])


def _qos_zeroed(folder: Path) -> Path:
    _mcap(folder / "x.mcap", [("/a", VECTOR, schema_text(VECTOR), VECTORS)], RELIABLE)
    return _metadata(folder, WHOLE, [])


def _no_index(folder: Path) -> Path:
    _mcap(folder / "x.mcap", [("/a", VECTOR, schema_text(VECTOR), VECTORS)], index_types=IndexType.NONE)
    return _metadata(folder, WHOLE)


def _no_summary(folder: Path) -> Path:
    bare: dict[str, Any] = dict.fromkeys(
        ("repeat_channels", "repeat_schemas", "use_statistics", "use_summary_offsets"), False
    )
    _mcap(folder / "x.mcap", [("/a", VECTOR, schema_text(VECTOR), VECTORS)], index_types=IndexType.NONE, **bare)
    return _metadata(folder, WHOLE)


def _no_schema(folder: Path) -> Path:
    _mcap(folder / "x.mcap", [("/a", VECTOR, None, VECTORS)])
    return _metadata(folder, WHOLE)


def _with_service(folder: Path) -> Path:
    """And no metadata.yaml."""
    events = {k: _numbers(1.0) for k in range(7)}
    _mcap(
        folder / "x.mcap",
        [("/a", VECTOR, schema_text(VECTOR), VECTORS), ("/set/_service_event", EVENT, SERVICE, events)],
    )
    return folder


def _rosbags(folder: Path, plugin: StoragePlugin, mode: CompressionMode = CompressionMode.NONE) -> Path:
    writer = Writer(folder, version=9, storage_plugin=plugin)
    if mode is not CompressionMode.NONE:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/a", VECTOR, typestore=typestore())
        for k, data in VECTORS.items():
            writer.write(connection, STAMPS_NS[k], data)
    return folder


def _half_in_log(folder: Path) -> Path:
    """A recorder was killed: 51 messages are in the file, 49 in its write-ahead log."""
    _rosbags(folder, StoragePlugin.SQLITE3)
    (database,) = folder.glob("*.db3")
    with sqlite3.connect(database) as writing:
        writing.execute("DELETE FROM messages WHERE id > 51")
    recorder = sqlite3.connect(database, isolation_level=None)
    recorder.execute("PRAGMA journal_mode=WAL")
    recorder.execute("PRAGMA wal_autocheckpoint=0")
    rows = [(k + 1, STAMPS_NS[k], VECTORS[k]) for k in range(51, 100)]
    recorder.executemany("INSERT INTO messages VALUES(?, 1, ?, ?)", rows)
    killed = folder.with_name("killed")
    shutil.copytree(folder, killed)
    recorder.close()
    for shared in killed.glob("*-shm"):
        shared.unlink()
    return killed


def _hot_journal(folder: Path) -> Path:
    """A writer was killed within a transaction that had thrown half of the messages away."""
    _rosbags(folder, StoragePlugin.SQLITE3)
    (database,) = folder.glob("*.db3")
    writing = sqlite3.connect(database, isolation_level=None)
    writing.execute("PRAGMA cache_size=1")
    writing.execute("BEGIN")
    writing.execute("DELETE FROM messages WHERE id > 51")
    writing.execute("UPDATE messages SET data = zeroblob(2000)")
    killed = folder.with_name("killed")
    shutil.copytree(folder, killed)
    writing.execute("ROLLBACK")
    writing.close()
    return killed


RECORDINGS: Mapping[str, Callable[[Path], Path]] = {
    "split with other QoS than metadata.yaml": _qos_differs,
    "QoS zeroed by hand": _qos_zeroed,
    "no message index": _no_index,
    "no summary": _no_summary,
    "no schema": _no_schema,
    "service events, no metadata.yaml": _with_service,
    "a write-ahead log": _half_in_log,
    "a hot journal": _hot_journal,
    "messages compressed": lambda folder: _rosbags(folder, StoragePlugin.MCAP, CompressionMode.MESSAGE),
    "file compressed": lambda folder: _rosbags(folder, StoragePlugin.MCAP, CompressionMode.FILE),
    "database compressed": lambda folder: _rosbags(folder, StoragePlugin.SQLITE3, CompressionMode.FILE),
}


def _history(source: Path, out: Path, *fields: str, **keys: object) -> tuple[NDArray[np.float64], ImportReport]:
    report = import_histories(source, mapping_of({"histories": [{"dgu": 1, "y": list(fields)}], **keys}, "test"), out)
    return np.concatenate([one.y for one in read_histories(out, 1)]), report


@pytest.mark.parametrize("kind", RECORDINGS)
def test_every_message_is_read(tmp_path: Path, kind: str) -> None:
    """100 of 100, with the right numbers, imported, played, checked and repaired; the recording is not changed."""
    source = RECORDINGS[kind](tmp_path / "bag")
    before = {one.name: one.read_bytes() for one in source.iterdir()}
    y, _ = _history(source, tmp_path / "out", "/a.vector.x", "/a.vector.y")
    np.testing.assert_array_equal(y, np.stack([X, Y], axis=1))
    topics = {one.name: one for one in describe_source(source).topics}
    assert (topics["/a"].messages, topics["/a"].unreadable) == (100, "")
    assert [name for name, one in topics.items() if one.unreadable] == sorted(topics)[1:]
    moments = open_playback(source, Selection()).moments()
    assert [data for one in moments for name, data in one.messages if name == "/a"] == list(VECTORS.values())
    if any(".mcap" in name for name in before):
        assert [str(one) for one in check(source).damages if "metadata.yaml: is missing" not in str(one)] == []
        assert repair(source, tmp_path / "repaired").undescribed == 0
        assert check(tmp_path / "repaired").clean
        again, _ = _history(tmp_path / "repaired", tmp_path / "again", "/a.vector.x", "/a.vector.y")
        np.testing.assert_array_equal(again, y)
    assert {one.name: one.read_bytes() for one in source.iterdir()} == before


def _two_topics(folder: Path) -> Path:
    first = {k: _numbers(X[k], Y[k]) for k in K.tolist()}
    second = {k: _numbers(Y[k], X[k]) for k in K.tolist()}
    return _mcap(folder / "x.mcap", [("/old", MEAS, VOLTS_FIRST, first), ("/new", MEAS, AMPERES_FIRST, second)])


def _two_channels(folder: Path) -> Path:
    """The definition changes from message to message."""
    first = {k: _numbers(X[k], Y[k]) for k in K.tolist()[::2]}
    second = {k: _numbers(Y[k], X[k]) for k in K.tolist()[1::2]}
    return _mcap(folder / "x.mcap", [("/old", MEAS, VOLTS_FIRST, first), ("/old", MEAS, AMPERES_FIRST, second)])


def _two_files(folder: Path) -> Path:
    """The definition changes at a split."""
    _mcap(folder / "r_0.mcap", [("/old", MEAS, VOLTS_FIRST, {k: _numbers(X[k], Y[k]) for k in range(50)})])
    _mcap(folder / "r_1.mcap", [("/old", MEAS, AMPERES_FIRST, {k: _numbers(Y[k], X[k]) for k in range(50, 100)})])
    return _metadata(folder, {"/old": (MEAS, 100)})


def _two_inside(folder: Path) -> Path:
    """The type inside the type changes at a split; the one outside stays."""
    for part, (text, ks) in enumerate(((VOLTS_FIRST, range(50)), (AMPERES_FIRST, range(50, 100)))):
        whole = f"lab_msgs/Meas m\n{'=' * 80}\nMSG: lab_msgs/Meas\n{text}"
        messages = {k: _numbers(X[k], Y[k]) if part == 0 else _numbers(Y[k], X[k]) for k in ks}
        _mcap(folder / f"r_{part}.mcap", [("/old", "lab_msgs/msg/Top", whole, messages)])
    return _metadata(folder, {"/old": ("lab_msgs/msg/Top", 100)})


def _other_than_installed(folder: Path) -> Path:
    """A standard name, and fields in another order."""
    messages = {k: _numbers(Y[k], X[k], 0.0) for k in K.tolist()}
    text = "float64 y\nfloat64 x\nfloat64 z\n"
    return _mcap(folder / "x.mcap", [("/old", "geometry_msgs/msg/Vector3", text, messages)], chunk_size=300)


@pytest.mark.parametrize(
    ("write", "fields"),
    [
        (_two_topics, ("/old.v", "/old.i")),
        (_two_topics, ("/new.v", "/new.i")),
        (_two_channels, ("/old.v", "/old.i")),
        (_two_files, ("/old.v", "/old.i")),
        (_two_inside, ("/old.m.v", "/old.m.i")),
        (_other_than_installed, ("/old.x", "/old.y")),
    ],
)
def test_two_definitions_of_one_type_are_both_read(
    tmp_path: Path, write: Callable[[Path], Path], fields: tuple[str, str]
) -> None:
    """Each message is read by the definition of its own channel; repair keeps what each channel says."""
    source = write(tmp_path / "bag")
    y, _ = _history(source, tmp_path / "out", *fields)
    np.testing.assert_array_equal(y, np.stack([X, Y], axis=1))
    repair(source, tmp_path / "repaired")
    again, _ = _history(tmp_path / "repaired", tmp_path / "again", *fields)
    np.testing.assert_array_equal(again, y)


def test_repair_of_a_broken_file_swaps_nothing(tmp_path: Path) -> None:
    """Fields in another order than those of the installed type are no damage, though only two letters differ."""
    source = _other_than_installed(tmp_path / "bag")
    source.write_bytes(source.read_bytes()[: source.stat().st_size // 2])
    kept = repair(source, tmp_path / "repaired").messages
    y, _ = _history(tmp_path / "repaired", tmp_path / "again", "/old.x", "/old.y")
    assert len(y) >= kept > 50
    np.testing.assert_array_equal(y, np.stack([X, Y], axis=1)[: len(y)])


def test_a_recorder_killed_behind_a_split_leaves_an_empty_file(tmp_path: Path) -> None:
    """The files before it are kept by a repair, which whoever reads the folder names."""
    source = _two_files(tmp_path / "bag")
    (source / "r_1.mcap").write_bytes(b"")
    with pytest.raises(BagError, match=r"is an empty file, .*`dcmg bag repair .*bag` keeps what is in the others"):
        describe_source(source)
    assert any("r_1.mcap" in str(one) for one in check(source).damages)
    assert repair(source, tmp_path / "repaired").messages == 50
    y, _ = _history(tmp_path / "repaired", tmp_path / "out", "/old.v", "/old.i")
    np.testing.assert_array_equal(y, np.stack([X, Y], axis=1)[:50])
    file = tmp_path / "alone.mcap"
    file.write_bytes(b"")
    with pytest.raises(BagError, match="is an empty file"):
        check(file)


def test_channels_without_messages_stand_in_the_summary_only(tmp_path: Path) -> None:
    """As rosbag2 writes them: the bag is clean."""
    _mcap(tmp_path / "bag" / "x.mcap", [("/a", VECTOR, schema_text(VECTOR), {})])
    assert check(_metadata(tmp_path / "bag", {"/a": (VECTOR, 0)})).damages == ()


@pytest.mark.parametrize("name", ["battery", "/a-b", "/a.b", "/a.vector", "/ä/ü", "/a b", "/a[0]", "/a*2", "~/p"])
def test_what_inspect_prints_is_what_history_takes(tmp_path: Path, name: str) -> None:
    """Topics without a slash, with dashes, dots, stars, brackets, umlauts."""
    beside = ("/a", VECTOR, schema_text(VECTOR), {k: VECTORS[99 - k] for k in K.tolist()})
    source = _mcap(tmp_path / "x.mcap", [(name, VECTOR, schema_text(VECTOR), VECTORS), beside])
    (one,) = (found for found in describe_source(source).topics if found.name == name)
    assert f"{name}.vector.x" in one.fields
    y, _ = _history(source, tmp_path / "out", f"{name}.vector.x")
    np.testing.assert_array_equal(y[:, 0], X)


def _table(file: Path, separator: str, rows: Sequence[Sequence[object]], above: str = "") -> Path:
    file.write_text(above + "".join(separator.join(map(str, row)) + "\n" for row in rows))
    return file


def test_two_columns_of_one_name_are_refused(tmp_path: Path) -> None:
    """Never the last one, also where only white space tells them apart."""
    for other in ("V", " V"):
        rows = [("t", "V", other), *((k / 100, X[k], Y[k]) for k in range(60))]
        with pytest.raises(BagError, match="2 columns are called 'V'"):
            _history(_table(tmp_path / "x.csv", ",", rows), tmp_path / "out", "V", time="t")


def test_blank_cell_is_a_sample_that_did_not_arrive(tmp_path: Path) -> None:
    """Counted, told, and not delivered."""
    rows = [("t", "V", "I"), *((k / 100, X[k], Y[k] if k < 40 or k % 7 else "") for k in range(100))]
    source = _table(tmp_path / "x.csv", ",", rows)
    mapping = mapping_of({"streams": [{"link": "1-2", "y": ["V", "I"]}], "time": "t"}, "test")
    report = import_streams(source, mapping, tmp_path / "out")
    delivered = read_run(tmp_path / "out").delivered
    np.testing.assert_array_equal(delivered[:, 0], [row[2] != "" for row in rows[1:]])
    assert report.missing == int((~delivered).sum()) == 9
    assert any("I: 9 samples are no finite numbers" in one for one in report.sentences())


def test_slower_column_is_bridged_up_to_a_stated_length(tmp_path: Path) -> None:
    """Without a length that suffices the refusal says which would."""
    rows = [("t", "V", "I"), *((k / 100, X[k], "" if k % 5 else Y[k]) for k in range(60))]
    source = _table(tmp_path / "x.csv", ",", rows)
    refused = r"I comes every 0.05 s, hold bridges at most 0.015 s: expected .*max-gap. of 0.05"
    with pytest.raises(BagError, match=refused):
        _history(source, tmp_path / "no", "V", "I", time="t", sampling={"policy": "hold"})
    slow = Y[: 5 * 12 : 5]
    for policy, wanted in (("hold", np.repeat(slow, 5)), ("linear", np.interp(K[:60], K[:60:5], slow))):
        sampling = {"policy": policy, "max_gap_sec": 0.051}
        y, _ = _history(source, tmp_path / policy, "V", "I", time="t", sampling=sampling)
        np.testing.assert_allclose(y[:, 0], X[: len(y)], rtol=0, atol=1e-9)
        np.testing.assert_allclose(y[:56, 1], wanted[:56], rtol=0, atol=1e-9)
