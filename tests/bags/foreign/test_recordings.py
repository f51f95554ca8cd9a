"""Recordings of every kind that rosbag2 writes, held against the library that wrote them, from one end to the other."""

import csv
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from numpy.typing import NDArray
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from bags.foreign.importing import import_histories
from bags.foreign.mapping import mapping_of
from bags.foreign.outline import describe_source
from bags.mcap.check import check
from bags.mcap.repair import repair
from bags.runs.playback import Selection, open_playback
from bags.sources.contents import contents
from bags.tables.export import export
from bags.tables.table_format import TableFormat
from bags.watch.histories import read_histories

KIND = "lab_msgs/msg/Meas"
PERIOD_NS = 10_000_000
START_NS = 1_700_000_000 * 10**9
FIELDS = {"v": "float64 v", "i": "float32 i", "n": "string n", "k": "uint8 k", "q": "float64[2] q"}
ORDERS = st.permutations(list(FIELDS)).map(tuple)
NUMBER = st.floats(-1e6, 1e6, allow_nan=False, width=32)
QOS = st.one_of(
    st.none(),
    st.builds(
        Qos,
        history=st.sampled_from(QosHistory),
        depth=st.integers(0, 1000),
        reliability=st.sampled_from(QosReliability),
        durability=st.sampled_from(QosDurability),
        deadline=st.just(QosTime(0, 0)),
        lifespan=st.just(QosTime(2147483647, 999999999)),
        liveliness=st.sampled_from(QosLiveliness),
        liveliness_lease_duration=st.just(QosTime(0, 0)),
        avoid_ros_namespace_conventions=st.booleans(),
    ),
)
ROWS = st.lists(st.tuples(NUMBER, NUMBER, st.sampled_from(["", "a", "ab", "änderung"])), min_size=2, max_size=12)


def _text(order: Sequence[str]) -> str:
    return "".join(f"{FIELDS[name]}\n" for name in order)


def _store(order: Sequence[str]) -> Any:  # noqa: ANN401 - of rosbags
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(_text(order), KIND))
    return store


def _message(store: Any, row: tuple[float, float, str]) -> bytes:  # noqa: ANN401 - idem
    v, i, n = row
    message = store.types[KIND](v=v, i=i, n=n, k=len(n), q=np.array([i, v]))
    return bytes(store.serialize_cdr(message, KIND))


def _imported(source: Path, out: Path) -> NDArray[np.float64]:
    y = ["/m.v", "/m.i", "/m.q[0]", "/m.q[1]", "/m.k"]
    mapping = mapping_of({"histories": [{"dgu": 1, "y": y}], "sampling_period_sec": 0.01}, "test")
    import_histories(source, mapping, out)
    return np.concatenate([one.y for one in read_histories(out, 1)])


def _holds(source: Path, folder: Path, rows: Sequence[tuple[float, float, str]], payloads: Sequence[bytes]) -> None:
    """Import, info, inspect, export and replay find what was written."""
    wanted = [[v, i, i, v, len(n)] for v, i, n in rows]
    np.testing.assert_array_equal(_imported(source, folder / "history"), wanted)
    assert [(one.name, one.count) for one in contents(source).topics] == [("/m", len(rows))]
    (topic,) = describe_source(source).topics
    assert (topic.messages, topic.unreadable) == (len(rows), "")
    exported = export(source, folder / "tables", TableFormat.CSV)
    with exported.files["/m"].open(newline="") as stream:
        table = [
            [float(one["v"]), np.float32(one["i"]), float(one["q[0]"]), float(one["q[1]"]), float(one["k"])]
            for one in csv.DictReader(stream)
        ]
    np.testing.assert_array_equal(table, wanted)
    assert not exported.unreadable
    played = [data for one in open_playback(source, Selection()).moments() for _, data in one.messages]
    assert played == list(payloads)


@settings(max_examples=25)
@given(
    plugin=st.sampled_from(StoragePlugin),
    mode=st.sampled_from(CompressionMode),
    parts=st.lists(st.tuples(ORDERS, ROWS, QOS), min_size=1, max_size=3),
    stated=QOS,
    hidden=st.booleans(),
)
def test_split_recordings_of_rosbags(  # noqa: PLR0917 - hypothesis gives one argument a kind
    tmp_path_factory: pytest.TempPathFactory,
    plugin: StoragePlugin,
    mode: CompressionMode,
    parts: list[tuple[tuple[str, ...], list[tuple[float, float, str]], Qos | None]],
    stated: Qos | None,
    hidden: bool,  # noqa: FBT001 - idem
) -> None:
    """Definitions of each file x storage x compression x split x QoS of file and metadata.yaml x no metadata.yaml."""
    folder = tmp_path_factory.mktemp("kind")
    bag = folder / "bag"
    bag.mkdir()
    if plugin is StoragePlugin.SQLITE3 and mode is CompressionMode.STORAGE:
        mode = CompressionMode.NONE  # sqlite3 has no such thing
    rows, payloads, told, k = list[tuple[float, float, str]](), list[bytes](), list[dict[str, Any]](), 0
    for number, (order, some, qos) in enumerate(parts):
        store, one = _store(order), folder / f"r_{number}"
        writer = Writer(one, version=9, storage_plugin=plugin)
        if mode is not CompressionMode.NONE:
            writer.set_compression(mode, CompressionFormat.ZSTD)
        with writer:
            connection = writer.add_connection("/m", KIND, typestore=store, offered_qos_profiles=[qos] if qos else [])
            for row in some:
                payloads.append(_message(store, row))
                writer.write(connection, START_NS + k * PERIOD_NS, payloads[-1])
                k += 1
        with Reader(one) as reader:  # what the library itself finds
            assert [bytes(data) for _, _, data in reader.messages()] == payloads[len(rows) :]
        rows += some
        told.append(yaml.safe_load((one / "metadata.yaml").read_text())["rosbag2_bagfile_information"])
        for file in one.iterdir():
            if file.name != "metadata.yaml":
                shutil.move(file, bag / file.name)
    information = told[0]
    information["relative_file_paths"] = [name for one in told for name in one["relative_file_paths"]]
    information["message_count"] = information["topics_with_message_count"][0]["message_count"] = len(rows)
    information["files"] = [one for part in told for one in part.get("files") or []]
    topic = information["topics_with_message_count"][0]["topic_metadata"]
    topic["offered_qos_profiles"] = "" if stated is None else [{"depth": stated.depth}]
    if not hidden:
        (bag / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": information}))
    before = {one.name: one.read_bytes() for one in bag.iterdir()}
    _holds(bag, folder, rows, payloads)
    if plugin is StoragePlugin.MCAP:
        assert {str(one) for one in check(bag).damages if "metadata.yaml: is missing" not in str(one)} == set()
        assert repair(bag, folder / "repaired").undescribed == 0
        assert check(folder / "repaired").clean
        np.testing.assert_array_equal(_imported(folder / "repaired", folder / "again"), _imported(bag, folder / "same"))
    assert {one.name: one.read_bytes() for one in bag.iterdir()} == before


@settings(max_examples=25)
@given(
    order=ORDERS,
    other=ORDERS,
    rows=ROWS,
    compression=st.sampled_from(CompressionType),
    index=st.sampled_from([IndexType.ALL, IndexType.NONE, IndexType.MESSAGE, IndexType.CHUNK]),
    switches=st.fixed_dictionaries(
        dict.fromkeys(
            (
                "use_chunking",
                "use_statistics",
                "use_summary_offsets",
                "repeat_channels",
                "repeat_schemas",
                "enable_crcs",
                "enable_data_crcs",
            ),
            st.booleans(),
        )
    ),
    chunk_size=st.sampled_from([1, 200, 1 << 20]),
)
def test_recordings_of_mcap(  # noqa: PLR0917 - idem
    tmp_path_factory: pytest.TempPathFactory,
    order: tuple[str, ...],
    other: tuple[str, ...],
    rows: list[tuple[float, float, str]],
    compression: CompressionType,
    index: IndexType,
    switches: dict[str, bool],
    chunk_size: int,
) -> None:
    """Two definitions on one topic x index x summary x chunks x check sums."""
    folder = tmp_path_factory.mktemp("kind")
    file, payloads = folder / "x.mcap", list[bytes]()
    with file.open("wb") as stream:
        writer = McapWriter(stream, chunk_size=chunk_size, compression=compression, index_types=index, **switches)
        writer.start("ros2", "test")
        stores = [_store(one) for one in (order, other)]
        channels = []
        for one in (order, other):
            schema = writer.register_schema(KIND, "ros2msg", _text(one).encode())
            channels.append(writer.register_channel("/m", "cdr", schema))
        for k, row in enumerate(rows):
            payloads.append(_message(stores[k % 2], row))
            writer.add_message(channels[k % 2], START_NS + k * PERIOD_NS, payloads[-1], START_NS + k * PERIOD_NS)
        writer.finish()  # type: ignore[no-untyped-call] # mcap leaves it without a type
    if index is IndexType.ALL and all(switches.values()):  # else the library passes messages over
        with file.open("rb") as stream:
            assert [one.data for _, _, one in make_reader(stream).iter_messages()] == payloads
    _holds(file, folder, rows, payloads)
    assert check(file).damages == ()
    assert repair(file, folder / "repaired").messages == len(rows)
    np.testing.assert_array_equal(_imported(folder / "repaired", folder / "again"), _imported(file, folder / "same"))
