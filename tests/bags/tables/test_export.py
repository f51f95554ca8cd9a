"""Bags as tables, data frames, data sets and files for other programs."""

import json
from pathlib import Path

import numpy as np
import pyarrow.csv
import pyarrow.parquet
import pytest
import xarray

from bags.mcap.bag import open_bag
from bags.mcap.errors import BagError
from bags.mcap.topic import Topic, TopicKind
from bags.mcap.writer import BagWriter
from bags.runs.run_record import RunRecord
from bags.tables import tabular
from bags.tables.export import export
from bags.tables.table_format import TableFormat
from bags.tables.tabular import dataframe, dataset, table, write_netcdf


@pytest.mark.parametrize("form", [TableFormat.CSV, TableFormat.PARQUET])
def test_tables_round_trip(bag: Path, record: RunRecord, tmp_path: Path, form: TableFormat) -> None:
    """Tables read back hold every bit of the numbers, text or not; what varies in length is JSON or lists."""
    report = export(bag, tmp_path / "tables", form)
    read = pyarrow.csv.read_csv if form is TableFormat.CSV else pyarrow.parquet.read_table
    state = read(report.files["/dgu_1/state"])
    assert state.column_names[:4] == ["time_ns", "header.stamp.sec", "header.stamp.nanosec", "step"]
    for component in range(3):
        assert state[f"x[{component}]"].to_pylist() == record.x[:, 0, component].tolist()
    history = read(report.files["/dgu_1/history"])
    y = history["y"].to_pylist()[0]
    assert (json.loads(y) if form is TableFormat.CSV else y) == record.histories[0].y.ravel().tolist()
    design = read(report.files["/dgu_2/design/dgu_1"]).to_pylist()[0]
    assert design["verdict"] == record.designs[record.links[2]].verdict
    counts = {name: topic.count for name, topic in open_bag(bag).topics.items()}
    assert set(report.left_out) == {name for name, count in counts.items() if not count}
    assert set(report.files) == {name for name, count in counts.items() if count}
    with pytest.raises(BagError, match="expected a new or empty folder"):
        export(bag, tmp_path / "tables", form)


def test_netcdf_is_the_data_set(bag: Path, record: RunRecord, tmp_path: Path) -> None:
    """The file, in one window or several, and the data set hold every bit of the run, with labels and units."""
    exported = export(bag, tmp_path / "out", TableFormat.NETCDF).files["run"]
    pieces = write_netcdf(bag, tmp_path / "pieces.nc", window_steps=77)
    with (
        xarray.open_dataset(exported, engine="h5netcdf") as found,
        xarray.open_dataset(pieces, engine="h5netcdf") as pieced,
    ):
        for one in (found, pieced, dataset(bag)):
            for name in ("x", "y", "alpha", "received", "residual", "threshold", "phase", "alarm", "delivered"):
                values = getattr(record, name)
                assert one[name].to_numpy().astype(values.dtype).tobytes() == values.tobytes(), name
            assert one["residual"].dims == ("step", "link", "component")
            assert one["load_current"].attrs["units"] == "A"
            assert one["time"].to_numpy().tolist() == record.time_sec.tolist()
            assert one["x"].sel(dgu=2, component="I_t").to_numpy().tolist() == record.x[:, 1, 1].tolist()
            assert one["link"].to_numpy().tolist() == [str(link) for link in record.links]


def test_data_frames(bag: Path, record: RunRecord) -> None:
    """A topic as a data frame: numbers as columns, messages in messages as dictionaries."""
    residual = dataframe(open_bag(bag), "/dgu_2/residual/dgu_1")
    assert type(residual).__name__ == "DataFrame"
    np.testing.assert_array_equal(residual["residual[2]"].to_numpy(), record.residual[:, 2, 2])
    diagnostics = dataframe(open_bag(bag), "/diagnostics")
    assert len(diagnostics) == 3 * 3  # monitors, whole seconds
    first = diagnostics["status"][0][0]
    assert (set(first), first["name"]) == ({"level", "name", "message", "hardware_id", "values"}, "monitor_1: link 2-1")
    assert table(open_bag(bag), "/attacks/events")["kind"].to_pylist() == ["bias"] * 3


def test_what_cannot_be_exported_is_named(bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Unknown topics, messages that are none and missing packages are one line each."""
    with pytest.raises(BagError, match="holds no topic '/nothing'"):
        table(open_bag(bag), "/nothing")
    chatter = Topic(name="/chatter", type_name="std_msgs/msg/String", publishers=("x",), kind=TopicKind.EVENT)
    alarms = Topic(name="/history", type_name="dcmg_msgs/msg/History", publishers=("x",), kind=TopicKind.EVENT)
    with BagWriter(tmp_path / "bag", [chatter, alarms]) as writer:
        writer.write("/history", 0, b"\0\1\0\0short")
    with pytest.raises(BagError, match="/history holds a message that is no dcmg_msgs/msg/History"):
        table(open_bag(tmp_path / "bag"), "/history")
    with pytest.raises(BagError, match="expected those of a run"):
        export(tmp_path / "bag", tmp_path / "out", TableFormat.NETCDF)

    def missing(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr(tabular, "import_module", missing)
    with pytest.raises(BagError, match="needs the Python package xarray"):
        dataset(bag)
