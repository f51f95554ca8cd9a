"""Foreign bags and tables become histories and streams."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer

from bags.foreign.importing import MAPPING_ATTACHMENT, REPORT_ATTACHMENT, import_histories, import_streams
from bags.foreign.mapping import Mapping, mapping_of
from bags.foreign.outline import describe_source
from bags.mcap.bag import open_bag
from bags.mcap.check import check
from bags.mcap.errors import BagError
from bags.runs.reader import open_run, read_run
from bags.runs.replay import replay
from bags.runs.run_record import RunRecord
from bags.tables.export import export
from bags.tables.table_format import TableFormat
from bags.watch.histories import read_all_histories, read_histories
from bags.wire.convert import history_of
from monitor.history import data_matrices

T = 10_000_000
CUSTOM = "lab_msgs/msg/Plant"


def _histories(*y: str, **keys: Any) -> Mapping:  # noqa: ANN401 - keys of a mapping
    return mapping_of({"histories": [{"dgu": 1, "y": list(y or ["/a.data[0]"])}], **keys}, "test")


def _ramp(steps: list[int]) -> tuple[list[int], list[list[float]]]:
    return [step * T for step in steps], [[float(step), -float(step)] for step in steps]


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("as_file", [False, True])
def test_bags_of_rosbags_with_types_of_their_own(
    store: Any,  # noqa: ANN401 - of rosbags
    tmp_path: Path,
    storage: StoragePlugin,
    as_file: bool,  # noqa: FBT001 - a parameter of the test
) -> None:
    """MCAP and sqlite3, folders and files: custom types are read by the definitions in the bag, header stamps count."""
    types = store.types
    header, time = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
    with Writer(tmp_path / "lab", version=9, storage_plugin=storage) as writer:
        connection = writer.add_connection("/plant", CUSTOM, typestore=store)
        for step in range(5):
            cell = types["lab_msgs/msg/Cell"](np.array([step, 2.0 * step, 3.0]))
            state = np.array([0.5 * step], dtype=np.float32)
            stamp = header(time(7, step * T), "")
            message = types[CUSTOM](stamp, [cell, cell], state, "x", step, good=True)
            writer.write(connection, 10**18 + step * 12_345_678, store.serialize_cdr(message, CUSTOM))
    source = (
        next(path for path in (tmp_path / "lab").iterdir() if path.suffix != ".yaml") if as_file else tmp_path / "lab"
    )
    signals = ["/plant.cells[1].level[1]", {"field": "/plant.state[0]", "unit": "mA", "scale": 2, "offset": 1}]
    entry = {"dgu": 3, "y": signals, "x": ["/plant.count"], "u": ["/plant.good"], "d": ["/plant.count*-1"]}
    mapping = mapping_of({"histories": [{**entry, "w": ["/plant.cells[0].level[0]"]}]}, "test")
    report = import_histories(source, mapping, tmp_path / "bag")
    assert (report.samples, report.missing, report.experiments) == (5, 0, {3: 1})
    (found,) = read_histories(tmp_path / "bag", 3)
    steps = np.arange(5.0)
    np.testing.assert_array_equal(found.y, np.column_stack([2.0 * steps, 0.5 * steps * 0.002 + 1.0]))
    np.testing.assert_array_equal(
        np.hstack([found.x, found.u, found.d, found.w]), np.column_stack([steps, steps * 0 + 1, -steps, steps])
    )
    assert found.sampling_period_sec == 0.01
    assert check(tmp_path / "bag").clean
    (described,) = describe_source(source).topics
    assert (described.name, described.messages, described.clock) == ("/plant", 5, "header")


@pytest.mark.parametrize("form", [TableFormat.CSV, TableFormat.PARQUET])
def test_run_through_tables_gives_the_same_residuals(
    record: RunRecord, bag: Path, tmp_path: Path, form: TableFormat
) -> None:
    """A run's received outputs, exported and imported again, are monitored to the same bits."""
    files = export(bag, tmp_path / "tables", form).files
    (link,) = [link for link in record.links if str(link) == "1-2"]
    stream = {"link": "1-2", "y": [f"y[{one}]" for one in range(3)], "delivered": "delivered"}
    data = {"time": {"field": "time_ns", "unit": "ns"}, "streams": [stream], "monitor": _monitor(record)}
    out = tmp_path / "stream"
    report = import_streams(files["/dgu_2/received/dgu_1"], mapping_of(data, "test"), out, bag)
    assert report.samples == record.steps
    found = replay(out)
    position = record.links.index(link)
    for name in ("received", "residual", "threshold", "alarm", "phase"):
        np.testing.assert_array_equal(getattr(found, name)[:, 0], getattr(record, name)[:, position], err_msg=name)
    assert [one.step for one in found.alarms] == [
        one.step for one in record.alarms if one.monitor == 2 and one.source == 1
    ]


def _monitor(record: RunRecord) -> Any:  # noqa: ANN401 - plain data
    import yaml  # noqa: PLC0415

    return yaml.safe_load(record.scenario_text)["monitor"]


def test_streams_are_runs_without_ground_truth(write_arrays: Callable[..., Path], tmp_path: Path, bag: Path) -> None:
    """The bag says where it comes from, reads as a run, and lacks only what nobody recorded."""
    source = write_arrays({"/a": _ramp([0, 1, 2, 5, 6]), "/b": _ramp([0, 1, 2, 3, 4, 5, 6])})
    streams = [{"link": "1-2", "y": ["/a.data[0]", "/a.data[1]"]}, {"link": "3-2", "y": ["/b.data[0]*10"]}]
    out = tmp_path / "stream"
    report = import_streams(source, mapping_of({"streams": streams}, "test"), out, bag)
    assert (report.samples, report.missing) == (7, 2)
    run = read_run(out)
    assert run.delivered.T.tolist() == [[True] * 3 + [False] * 2 + [True] * 2, [True] * 7]
    np.testing.assert_array_equal(run.received[:3, 0, :2], [[0.0, 0.0], [1.0, -1.0], [2.0, -2.0]])
    np.testing.assert_array_equal(run.received[:, 1, 0], 10.0 * np.arange(7.0))
    assert np.isnan(run.x).all()
    assert np.isnan(run.residual).all()
    assert {one.dgu for one in run.histories} == {1, 3}
    assert {MAPPING_ATTACHMENT, REPORT_ATTACHMENT, "monitor.yaml", "versions.json"} <= set(run.attachments)
    assert json.loads(run.attachments[REPORT_ATTACHMENT])["sampling"]["streams"]["rows"] == 7
    assert check(out).clean
    with pytest.raises(BagError, match="holds no history of DGU 1, expected one"):
        replay(import_streams(source, mapping_of({"streams": streams[:1]}, "test"), tmp_path / "bare").out)


def test_missing_samples_are_nan_and_long_gaps_end_an_experiment(
    write_arrays: Callable[..., Path], tmp_path: Path
) -> None:
    """What is missing is NaN, no pair of samples reaches across it, and behind a long gap a new experiment starts."""
    source = write_arrays({"/a": _ramp([0, 1, 2, 5, 6, 8, 300, 301, 302])})
    report = import_histories(source, _histories(), tmp_path / "bag")
    records = read_histories(tmp_path / "bag", 1)
    nothing = math.nan
    assert [len(one.y) for one in records] == [9, 3]
    np.testing.assert_array_equal(records[0].y[:, 0], [0, 1, 2, nothing, nothing, 5, 6, nothing, 8])
    assert (report.samples, report.missing) == (12, 3)
    (look,) = report.grids["histories.0"].regularities
    assert [(round(gap.after_sec, 9), round(gap.length_sec, 9)) for gap in look.gaps] == [
        (0.02, 0.03),
        (0.06, 0.02),
        (0.08, 2.92),
    ]
    # a history of one state and one output needs two pairs: 0-1, 1-2, 5-6, 300-301, 301-302 are there
    matrices = data_matrices(history_of(records))
    np.testing.assert_array_equal(matrices.X_p[0], [0, 1, 5, 300, 301])
    np.testing.assert_array_equal(matrices.X_f[0], [1, 2, 6, 301, 302])


def test_disorder_is_found_and_told(write_arrays: Callable[..., Path], tmp_path: Path) -> None:
    """Repeated and disordered stamps are counted and put right; one that says something else is refused."""
    # rosbags sorts by recording time, so disorder shows in a table
    file = tmp_path / "lab.csv"
    file.write_text("t,V\n0,0\n0.01,1\n0.03,3\n0.02,2\n0.02,2\n0.04,\n0.05,5\n")
    report = import_histories(file, _histories("V", time="t"), tmp_path / "bag")
    (look,) = report.grids["histories.0"].regularities
    assert (look.repeated, look.conflicting, look.out_of_order) == (1, 0, 2)
    assert any("out of order" in line for line in report.sentences())
    (found,) = read_histories(tmp_path / "bag", 1)
    np.testing.assert_array_equal(found.y[:, 0], [0, 1, 2, 3, math.nan, 5])
    file.write_text("t,V\n0,0\n0.01,1\n0.01,7\n0.02,2\n")
    with pytest.raises(BagError, match="repeat a stamp with other values"):
        import_histories(file, _histories("V", time="t"), tmp_path / "other")
    source = write_arrays({"/a": _ramp([0, 1, 1, 2])})
    assert import_histories(source, _histories(), tmp_path / "same").samples == 3


def test_policies_resample_only_when_asked(write_arrays: Callable[..., Path], tmp_path: Path) -> None:
    """A slow topic beside a fast one is refused, held, or drawn as a line."""
    slow = ([step * 2 * T for step in range(6)], [[2.0 * step] for step in range(6)])
    source = write_arrays({"/a": _ramp(list(range(11))), "/b": slow})
    with pytest.raises(BagError, match=r"/b comes every 0\.02 s, the sampling period is 0.01 s"):
        import_histories(source, _histories("/a.data[0]", "/b.data[0]"), tmp_path / "refused")
    expected = {"hold": [0, 0, 2, 2, 4, 4, 6, 6, 8, 8, 10], "linear": list(range(11))}
    for policy, values in expected.items():
        sampling = {"policy": policy, "max_gap_sec": 0.021}
        mapping = _histories("/a.data[0]", "/b.data[0]", sampling=sampling)
        import_histories(source, mapping, tmp_path / policy)
        (found,) = read_histories(tmp_path / policy, 1)
        np.testing.assert_allclose(found.y[:, 1], values, rtol=0, atol=1e-12)


def test_jitter_beyond_the_tolerance_is_refused_and_told(write_arrays: Callable[..., Path], tmp_path: Path) -> None:
    """Stamps that are off by more than the tolerance are no samples, unless the policy or the tolerance allows it."""
    stamps = [0, T, 2 * T, 3 * T + 4_000_000, 4 * T, 5 * T]
    source = write_arrays({"/a": (stamps, [[float(step)] for step in range(6)])})
    with pytest.raises(
        BagError, match=r"irregular sampling, 1 messages are more than 1% .* on /a by 0.004 s at 0.034 s"
    ):
        import_histories(source, _histories(sampling_period_sec=0.01), tmp_path / "refused")
    for position, sampling in enumerate(({"policy": "nearest"}, {"tolerance": 0.45})):
        report = import_histories(
            source, _histories(sampling=sampling, sampling_period_sec=0.01), tmp_path / f"{position}"
        )
        assert (report.samples, report.missing) == (6, 0)


def test_part_of_a_recording(write_arrays: Callable[..., Path], tmp_path: Path) -> None:
    """Two experiments from two windows of one bag, and the rest as a stream."""
    source = write_arrays({"/a": _ramp(list(range(100)))})
    windows: list[dict[str, Any]] = [{"stop_sec": 0.2}, {"start_sec": 0.5, "stop_sec": 0.6}]
    entries = [{"dgu": 1, "y": ["/a.data[0]"], **window} for window in windows]
    mapping = mapping_of(
        {"histories": entries, "streams": [{"link": "1-2", "y": ["/a.data[0]"]}], "start_sec": 0.7}, "t"
    )
    import_histories(source, mapping, tmp_path / "bag")
    assert [one.y[:, 0].tolist() for one in read_all_histories(tmp_path / "bag")] == [
        list(range(20)),
        list(range(50, 60)),
    ]
    import_streams(source, mapping, tmp_path / "stream")
    assert open_run(tmp_path / "stream").steps == 30
    assert open_bag(tmp_path / "stream").topics["/dgu_2/received/dgu_1"].count == 30


def test_errors_are_one_line_each(write_arrays: Callable[..., Path], store: Any, tmp_path: Path) -> None:  # noqa: ANN401
    """Missing topic, field, index, number, overlap, type, clock or file: one line that names the source."""
    late = ([200 * T + step * T for step in range(5)], [[1.0]] * 5)
    source = write_arrays({"/a": _ramp(list(range(10))), "/late": late, "/empty": ([], []), "/one": ([0], [[1.0]])})
    jump = write_arrays({"/a": ([0, T, 2 * T, 10**9 * T], [[1.0]] * 4)}, name="jump")
    with Writer(tmp_path / "zeros", version=9) as writer:
        kind = "geometry_msgs/msg/PointStamped"
        connection = writer.add_connection("/a", kind, typestore=store)
        types = store.types
        header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](0, 0), "")
        message = types[kind](header, types["geometry_msgs/msg/Point"](1.0, 2.0, 3.0))
        for step in range(3):
            writer.write(connection, step * T, store.serialize_cdr(message, kind))
    (tmp_path / "text").write_text("nothing")
    (tmp_path / "broken.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(50))
    cases = (
        (source, _histories("/nowhere.data[0]"), "holds no topic /nowhere, expected one of /a, /empty, /late, /one"),
        (source, _histories("/a.speed"), "std_msgs/msg/Float64MultiArray has no field 'speed'"),
        (
            source,
            _histories("/a.data[2]"),
            r"index 2 is out of range, the message has 2 elements \(/a, recorded at",
        ),
        (source, _histories("/a.layout"), "is a message std_msgs/msg/MultiArrayLayout, expected a number"),
        (
            source,
            _histories("/a.data[0]", "/late.data[0]"),
            "no overlap in time, /late begins 1.91 s after the end of /a",
        ),
        (source, _histories("/empty.data[0]"), "/empty holds no message"),
        (source, _histories("/one.data[0]"), "/one holds 1 messages with 1 instants, expected two or more to detect"),
        (
            source,
            _histories(stamps="header"),
            "stamps = 'header': /a is std_msgs/msg/Float64MultiArray, which has no header",
        ),
        (source, _histories(time="t"), "is a bag, whose messages have stamps: expected no key time"),
        (source, mapping_of({}, "test"), "the mapping has no key histories"),
        (jump, _histories(), "4 messages in .* s, expected about one each .* do the stamps jump"),
        (
            tmp_path / "zeros",
            _histories("/a.point.x", stamps="header"),
            "every header stamp is 0, expected instants: use stamps: recorded",
        ),
        (tmp_path / "text", _histories(), "starts with b'nothing' and is no recording that is known here"),
        (tmp_path / "broken.mcap", _histories(), "breaks off without an MCAP footer.*: `dcmg bag repair"),
        (tmp_path / "none", _histories(), "no such file or folder, expected a bag or a table"),
    )
    for path, mapping, what in cases:
        with pytest.raises(BagError, match=what) as error:
            import_histories(path, mapping, tmp_path / "bag")
        assert str(path) in str(error.value)
        assert "\n" not in str(error.value)
        assert not (tmp_path / "bag").exists()


def test_unknown_type_is_named(tmp_path: Path) -> None:
    """A bag without definitions of a type that nobody knows: one line that names topic and type."""
    with Writer(tmp_path / "bag", version=8) as writer:
        connection = writer.add_connection("/a", "none_msgs/msg/None", msgdef="", rihs01="RIHS01_0")
        writer.write(connection, 0, b"\x00\x01\x00\x00")
    with pytest.raises(BagError, match="none_msgs/msg/None") as error:
        import_histories(tmp_path / "bag", _histories(), tmp_path / "out")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("t,V\n0,1\n1,x\n", "column V holds 'x' in line 3, expected a number"),
        ("t,V\n0,1\n,2\n", "column t holds no instant in line 3"),
        ("t,V\n0,1\n1\n", "line 3 has 1 cells, expected 2"),
        ("t,W\n0,1\n1,2\n", "has no column 'V', found 't', 'W'"),
        ("t,V\n", "holds 0 rows"),
        ("t,V\n0,1\n", "holds 1 messages with 1 instants"),
        ("", "is an empty file"),
    ],
)
def test_tables_that_are_none(tmp_path: Path, text: str, what: str) -> None:
    """Missing columns and what is no number are one line each."""
    file = tmp_path / "lab.csv"
    file.write_text(text)
    with pytest.raises(BagError, match=what) as error:
        import_histories(file, _histories("V", time="t"), tmp_path / "bag")
    assert "\n" not in str(error.value)


def test_tables_without_instants(tmp_path: Path) -> None:
    """Parquet and CSV are read alike; without a time column the sampling period must be stated."""
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    parquet.write_table(arrow.table({"V": [1.0, None, 3]}), tmp_path / "lab.parquet")
    (tmp_path / "lab.csv").write_text("V\n1\nnan\n3\n")
    found = []
    for name in ("lab.parquet", "lab.csv"):
        import_histories(tmp_path / name, _histories("V", sampling_period_sec=0.5), tmp_path / f"{name}_bag")
        found += read_histories(tmp_path / f"{name}_bag", 1)
        with pytest.raises(BagError, match="found no key time, expected it or sampling_period_sec"):
            import_histories(tmp_path / name, _histories("V"), tmp_path / "refused")
    for one in found:
        np.testing.assert_array_equal(one.y, [[1.0], [math.nan], [3.0]])
        np.testing.assert_array_equal(one.x, one.y)
        assert one.sampling_period_sec == 0.5
    (tmp_path / "bad.parquet").write_text("nothing")
    with pytest.raises(BagError, match="cannot be read as Parquet"):
        import_histories(tmp_path / "bad.parquet", _histories("V", sampling_period_sec=0.5), tmp_path / "refused")
