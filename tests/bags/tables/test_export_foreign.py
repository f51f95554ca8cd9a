"""Other programs' recordings as tables: numbers behind texts, texts, formulas, names that would fall together."""

import csv
from pathlib import Path

import numpy as np
import pyarrow.parquet
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from bags.mcap.bag import open_bag
from bags.mcap.typestore import typestore
from bags.tables.export import export
from bags.tables.table_format import TableFormat

FIX = "sensor_msgs/msg/NavSatFix"
TEXT = "std_msgs/msg/String"


def _fix(frame_id: str, number: int) -> bytes:
    types = typestore().types
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](number, 0), frame_id)
    status = types["sensor_msgs/msg/NavSatStatus"](status=2, service=3)
    message = types[FIX](
        header=header,
        status=status,
        latitude=float(number),
        longitude=8.0,
        altitude=100.0,
        position_covariance=np.arange(9.0),
        position_covariance_type=1,
    )
    return bytes(typestore().serialize_cdr(message, FIX))


def _recording(path: Path, plugin: StoragePlugin, texts: list[str]) -> Path:
    writer = Writer(path, version=9, storage_plugin=plugin)
    writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer:
        fix = writer.add_connection("/s", FIX, typestore=typestore())
        words = {name: writer.add_connection(name, TEXT, typestore=typestore()) for name in ("/a/b", "/a_b", "/A/b")}
        for number, text in enumerate(texts):
            writer.write(fix, number, _fix(text, number))
            for name, one in words.items():
                message = typestore().types[TEXT](data=f"{text}{name}")
                writer.write(one, number, bytes(typestore().serialize_cdr(message, TEXT)))
    return path


def test_numbers_behind_a_text_of_any_length(tmp_path: Path) -> None:
    """Whatever frame_id is, the status behind it is 2; texts are columns, no formula is executed, no file lost."""
    texts = ["", "a", "ab", "abc", "abcd", "=1+1", "-5", "@x"] * 200
    for plugin in StoragePlugin:
        bag = _recording(tmp_path / plugin.name, plugin, texts)
        report = export(bag, tmp_path / f"{plugin.name}_csv", TableFormat.CSV)
        assert len(set(report.files.values())) == len(report.files) == 4
        with report.files["/s"].open(newline="") as stream:
            rows = list(csv.DictReader(stream))
        assert [row["status.status"] for row in rows] == ["2"] * len(texts)
        assert [row["position_covariance[8]"] for row in rows] == ["8"] * len(texts)
        wanted = [f"'{one}" if one[:1] in {"=", "@"} else one for one in texts]
        assert [row["header.frame_id"] for row in rows] == wanted
        assert any("apostrophe" in note for note in report.notes)
        parquet = export(bag, tmp_path / f"{plugin.name}_parquet", TableFormat.PARQUET)
        found = pyarrow.parquet.read_table(parquet.files["/a_b"])
        assert found["data"].to_pylist() == [f"{text}/a_b" for text in texts]


def test_array_reads_numbers_behind_a_text(tmp_path: Path) -> None:
    """`Bag.array` finds them too, in one block or several."""
    texts = ["", "a", "ab", "abcd", "abcde"] * 100
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        fix = writer.add_connection("/s", FIX, typestore=typestore())
        for number, text in enumerate(texts):
            writer.write(fix, number, _fix(text, number))
    block = open_bag(tmp_path / "bag").array("/s")
    assert set(block.data["status.status"].tolist()) == {2}
    assert block.data["latitude"].tolist() == [float(number) for number in range(len(texts))]
    assert [one.decode() for one in block.data["header.frame_id"].tolist()] == texts
