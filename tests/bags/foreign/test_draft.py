"""Drafts of mapping files, of bags, tables and flight logs: valid, and honest about what only a person can say."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin, Writer
from typer.testing import CliRunner

from bags.foreign.draft import draft_mapping, missing_of
from bags.foreign.importing import import_histories
from bags.foreign.mapping import mapping_of
from bags.foreign.outline import describe_source
from bags.mcap.errors import BagError
from bags.watch.histories import read_histories
from dcmg.commands.imports import app

BATTERY, TEMPERATURE = "sensor_msgs/msg/BatteryState", "sensor_msgs/msg/Temperature"


def _bag(path: Path, store: Any) -> Path:  # noqa: ANN401 - of rosbags
    """A battery every 10 ms, a thermometer every 50 ms."""
    types = store.types
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        battery = writer.add_connection("/bench/battery", BATTERY, typestore=store)
        thermometer = writer.add_connection("/bench/heat", TEMPERATURE, typestore=store)
        for k in range(100):
            stamp = 10**18 + k * 10**7
            header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](*divmod(stamp, 10**9)), "")
            cells = np.zeros(0, dtype=np.float32)
            numbers = (48.0 + k, 20.0, float(k), 0.0, 0.0, 0.0, 0.0)
            message = types[BATTERY](header, *numbers, 0, 0, 0, True, cells, cells, "", "")  # noqa: FBT003 - as rosbags has it
            writer.write(battery, stamp, store.serialize_cdr(message, BATTERY))
            if k % 5 == 0:
                warm = types[TEMPERATURE](header, 20.0, 0.1)
                writer.write(thermometer, stamp, store.serialize_cdr(warm, TEMPERATURE))
    return path


def test_draft_of_a_bag_is_a_mapping(tmp_path: Path, store: Any) -> None:  # noqa: ANN401 - of rosbags
    """Voltage and current are found by name, rates are told, and the file imports as it stands."""
    source, file = _bag(tmp_path / "lab", store), tmp_path / "mapping.yaml"
    done = CliRunner().invoke(app, ["draft", str(source), "--out", str(file)])
    assert done.exit_code == 0
    assert "which DGU was measured" in done.output
    assert "whether /bench/battery.voltage, /bench/battery.current are in SI units" in done.output
    text = file.read_text()
    assert "/bench/battery.voltage  # V?, every 0.01 s, 100 messages" in text
    assert "several rates (0.01 s, 0.05 s)" in text
    mapping = yaml.safe_load(text)
    assert mapping["streams"][0]["y"] == ["/bench/battery.voltage", "/bench/battery.current"]
    import_histories(source, mapping_of(mapping, "test"), tmp_path / "history")
    (history,) = read_histories(tmp_path / "history", 1)
    np.testing.assert_array_equal(history.y, [[48.0 + k, float(k)] for k in range(100)])
    again = CliRunner().invoke(app, ["draft", str(source), "--out", str(file)])
    assert (again.exit_code, type(again.exception).__name__) == (1, "CommandError")
    assert file.read_text() == text


@pytest.mark.parametrize(
    ("head", "time", "y"),
    [
        ("sampling_time,input,y", "sampling_time", ["y"]),
        ("t [s],V_bus [V],I_t [A]", "t [s]", ["V_bus [V]", "I_t [A]"]),
        ("Zeit,u1,y1", "Zeit", ["y1"]),
        ("elapsed,samples,output", "elapsed", ["output"]),
        ("p,q,r", None, ["p"]),
    ],
)
def test_draft_of_a_table_finds_clock_and_outputs(tmp_path: Path, head: str, time: str | None, y: list[str]) -> None:
    """By the names of the columns, and says where they do not tell."""
    file = tmp_path / "lab.csv"
    file.write_text(head + "\n" + "".join(f"{k / 100},{k % 7},{k % 5}\n" for k in range(50)))
    outline = describe_source(file)
    mapping = yaml.safe_load(draft_mapping(file, outline))
    assert mapping.get("time") == time
    assert mapping["histories"][0]["y"] == y
    assert any("column of the instants" in line for line in missing_of(outline)) == (time is None)
    keys = mapping if time else {**mapping, "sampling_period_sec": 0.01}
    report = import_histories(file, mapping_of(keys, "test"), tmp_path / "out")
    assert report.samples == 50


def test_draft_names_what_cannot_be_read(tmp_path: Path) -> None:
    """In the file, and in the exit code."""
    file = tmp_path / "x.mcap"
    with file.open("wb") as stream:
        writer = McapWriter(stream)
        writer.start("ros2", "test")
        channel = writer.register_channel("/words", "json", writer.register_schema("W", "jsonschema", b"{}"))
        writer.add_message(channel, 0, b"{}", 0)
        writer.finish()  # type: ignore[no-untyped-call] # mcap leaves it without a type
    done = CliRunner().invoke(app, ["draft", str(file)])
    assert done.exit_code == 3
    assert "# left out, /words: its messages are encoded as 'json'" in done.output
    assert "a numeric field: none was found" in done.output


def _record(kind: bytes, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), kind[0]) + body


def _ulog(file: Path, *, dropout_ms: int = 0) -> Path:
    """A flight log as PX4 documents it: two batteries, 10 ms apart."""
    text = b"\x55\x4c\x6f\x67\x01\x12\x35\x01" + struct.pack("<Q", 5_000_000)
    text += _record(b"B", bytes(40))
    text += _record(b"F", b"battery_status:uint64_t timestamp;float voltage_v;float[2] cells;uint8_t id;")
    for instance in (0, 1):
        text += _record(b"A", struct.pack("<BH", instance, instance) + b"battery_status")
    for k in range(100):
        for instance in (0, 1):
            values = (5_000_000 + 10_000 * k, 48.5 + k + 100 * instance, 1.0 + k, 2.0 + k, instance)
            text += _record(b"D", struct.pack("<HQfffB", instance, *values))
        if dropout_ms and k == 50:
            text += _record(b"O", struct.pack("<H", dropout_ms))
    file.write_bytes(text)
    return file


def test_flight_logs(tmp_path: Path) -> None:
    """Both instances, arrays and stamps of a ULog are those that were written; a dropout is told."""
    pytest.importorskip("pyulog")
    source = _ulog(tmp_path / "flight.ulg", dropout_ms=40)
    outline = describe_source(source)
    assert [one.name for one in outline.topics] == ["/battery_status", "/battery_status_1"]
    assert {one.messages for one in outline.topics} == {100}
    assert any("dropped data 1 times, 0.04 s" in note for note in outline.notes)
    mapping = yaml.safe_load(draft_mapping(source, outline))
    assert mapping["histories"][0]["y"] == ["/battery_status.voltage_v"]
    source.write_bytes(source.read_bytes() + b"\x17\x00D1")
    assert "the log breaks off: its last 4 bytes are no whole message" in describe_source(source).notes
    y = ["/battery_status.voltage_v", "/battery_status_1.voltage_v", "/battery_status.cells[1]"]
    report = import_histories(source, mapping_of({"histories": [{"dgu": 1, "y": y}]}, "test"), tmp_path / "out")
    (history,) = read_histories(tmp_path / "out", 1)
    np.testing.assert_array_equal(history.y, [[48.5 + k, 148.5 + k, 2.0 + k] for k in range(100)])
    assert history.sampling_period_sec == 0.01
    assert report.missing == 0


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (lambda data: data[:20], "damaged"),
        (lambda data: data[:16], "holds no topic"),
        (lambda data: b"x" + data[1:], "cannot be read as a ULog"),
        (lambda _: b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n", "Git LFS pointer"),
        (lambda _: b"", "empty file"),
    ],
)
def test_what_is_no_flight_log_is_one_line(tmp_path: Path, change: Any, what: str) -> None:  # noqa: ANN401
    """Cut, damaged, a pointer, empty."""
    pytest.importorskip("pyulog")
    source = _ulog(tmp_path / "flight.ulg")
    source.write_bytes(change(source.read_bytes()))
    mapping = mapping_of({"histories": [{"dgu": 1, "y": ["/battery_status.voltage_v"]}]}, "test")
    with pytest.raises(BagError, match=what):
        import_histories(source, mapping, tmp_path / "out")
