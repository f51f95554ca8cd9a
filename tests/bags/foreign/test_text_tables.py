"""Tables as people and programs write them, held against what was written."""

import datetime as dt
import math
from decimal import Decimal
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bags.foreign.cells import MISSING
from bags.foreign.columns import ColumnKind, read_columns
from bags.foreign.importing import import_histories, import_streams
from bags.foreign.mapping import mapping_of
from bags.foreign.tables import open_table
from bags.mcap.errors import BagError
from bags.runs.reader import read_run
from bags.watch.histories import read_histories

NUMBERS = st.floats(min_value=-1e6, max_value=1e6, allow_nan=False).map(lambda one: float(f"{one:.9g}"))
ZONES = {"": 0, "Z": 0, "+02:00": 7200, "-0530": -19800, "+01": 3600}
BEGIN = dt.datetime(2025, 3, 30, 0, 59, 58, tzinfo=dt.UTC)


@settings(max_examples=150, derandomize=True, deadline=None)
@given(
    separator=st.sampled_from([",", ";", "\t", "|", "  "]),
    comma=st.booleans(),
    rows=st.lists(st.tuples(NUMBERS, st.one_of(NUMBERS, st.none())), min_size=3, max_size=30),
    missing=st.sampled_from(sorted(MISSING - {""})),
    units=st.booleans(),
    zone=st.sampled_from([None, *ZONES]),
    quoted=st.booleans(),
    basic=st.booleans(),
    ending=st.sampled_from(["\n", "\r\n"]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]),
)
def test_every_way_to_write_a_table(  # noqa: PLR0917 - hypothesis gives one argument a kind
    tmp_path_factory: pytest.TempPathFactory,
    separator: str,
    comma: bool,  # noqa: FBT001 - idem
    rows: list[tuple[float, float | None]],
    missing: str,
    units: bool,  # noqa: FBT001 - idem
    zone: str | None,
    quoted: bool,  # noqa: FBT001 - idem
    basic: bool,  # noqa: FBT001 - idem
    ending: str,
    encoding: str,
) -> None:
    """Separator x decimal x missing x units x clock x quotes x line ending x encoding: what was written is read."""
    blanks = separator == "  "
    comma = comma and not blanks and (separator != "," or (quoted and zone is None))  # else "1,234" may be a thousand
    missing = "nan" if blanks and (" " in missing or not missing) else missing
    quoted, encoding = quoted and not blanks, "utf-8" if blanks else encoding

    def cell(value: float | None) -> str:
        text = missing if value is None else repr(value).replace(".", "," if comma else ".")
        return f'"{text}"' if quoted else text

    times = [BEGIN + dt.timedelta(milliseconds=10 * number) for number in range(len(rows))]
    clock = [
        cell(0.01 * number)
        if zone is None
        else time.strftime("%Y%m%dT%H%M%S.%f" if basic else "%Y-%m-%dT%H:%M:%S.%f") + zone
        for number, time in enumerate(times)
    ]
    lines = [["t", "V", "I"], *([["s", "mV", "°"]] if units else [])]
    lines += [[when, cell(V), cell(current)] for when, (V, current) in zip(clock, rows, strict=True)]
    file = tmp_path_factory.mktemp("table") / "lab.txt"
    file.write_bytes("".join(separator.join(line) + ending for line in lines).encode(encoding))
    table = open_table(file)
    assert [one.unit for one in table.columns] == (["s", "mV", "°"] if units else ["", "", ""])
    found = read_columns(table, ["t", "V", "I"])
    np.testing.assert_array_equal(found["V"], [V for V, _ in rows])
    np.testing.assert_array_equal(found["I"], [math.nan if one is None else one for _, one in rows])
    if zone is None:
        np.testing.assert_array_equal(found["t"], [0.01 * number for number in range(len(rows))])
    else:
        wanted = [(int(time.timestamp()) - ZONES[zone]) * 10**9 + time.microsecond * 1000 for time in times]
        assert found["t"].tolist() == wanted


def test_wrong_cells_are_named_as_an_editor_counts(tmp_path: Path) -> None:
    """The line of the file, comments, units and blank lines counted."""
    file = tmp_path / "lab.csv"
    file.write_text("# a bench\nt,V,note\ns,V,\n0,1,fine\n\n1,2,fine\n2,what,odd\n")
    table = open_table(file)
    assert [one.kind for one in table.columns] == [ColumnKind.NUMBER, ColumnKind.NUMBER, ColumnKind.TEXT]
    with pytest.raises(BagError, match="column V holds 'what' in line 7, expected a number"):
        read_columns(table, ["V"])
    file.write_text("t,V\n0,1\n1,2,3\n")
    with pytest.raises(BagError, match="line 3 has 3 cells, expected 2"):
        read_columns(open_table(file), ["V"])
    file.write_text("t,V, V\n0,1,2\n")
    with pytest.raises(BagError, match="2 columns are called 'V'"):
        read_columns(open_table(file), ["V"])


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ('t,V\n0,1.5\n1,2.5\n2,"3,5"\n', r"column V holds '3,5' in line 4, expected a number \(with a decimal point"),
        ("t;V\n0,1;1,5\n0,2;1.002,5\n", r"holds '1.002,5' in line 3, expected a number \(with a decimal comma"),
        ("t,V\n0,1 V\n1,2 V\n", r"column V holds '1 V' in line 2, expected a number .*no unit"),
        (
            't,V\n0,"1,234"\n1,"2,345"\n',
            r"column V holds '1,234' in line 2, expected a number .*nothing between thousands",
        ),
        ("t,V\n0,03/30/2025 1:00\n1,03/30/2025 1:01\n", r"expected a time as in 2025-03-30T00:59:59"),
        ("Device: X\nSerial: 7\n\nt,V\n0,1\n1,2\n", r"line 4 looks like the names of the columns.*put # before"),
        ("t V\n0 1\n1 2 3\n2 3\n", r"line 3 has 3 cells, expected 2"),
        ("0,1\n1,2\n", r"the first row holds numbers"),
    ],
)
def test_what_cannot_be_read_says_what_would_mend_it(tmp_path: Path, text: str, what: str) -> None:
    """Line, column, cell, and how it would be read."""
    file = tmp_path / "lab.csv"
    file.write_text(text)
    with pytest.raises(BagError, match=what):
        read_columns(open_table(file), ["V"])


def test_names_in_a_comment(tmp_path: Path) -> None:
    """As numpy writes a table, with blanks or commas."""
    values = np.stack([0.01 * np.arange(20), np.round(48 + np.sin(np.arange(20.0)), 6)], axis=1)
    for separator in (" ", ","):
        np.savetxt(tmp_path / "lab.txt", values, header=f"a bench\nt{separator}V", delimiter=separator, fmt="%.9f")
        found = read_columns(open_table(tmp_path / "lab.txt"), ["t", "V"])
        np.testing.assert_array_equal(np.stack([found["t"], found["V"]], axis=1), values)


def test_stated_units_count_where_the_mapping_says_nothing(tmp_path: Path) -> None:
    """Millivolts become volts once, milliseconds seconds, and a unit of the mapping wins."""
    file = tmp_path / "lab.csv"
    file.write_text("t,V\nms,mV\n" + "".join(f"{10 * number},{48000 + number}\n" for number in range(5)))
    for y in ("V", "V*0.001", {"field": "V", "unit": "mV"}):
        out = tmp_path / f"out_{len(list(tmp_path.iterdir()))}"
        report = import_histories(file, mapping_of({"histories": [{"dgu": 1, "y": [y]}], "time": "t"}, "test"), out)
        (history,) = read_histories(out, 1)
        np.testing.assert_allclose(history.y[:, 0], 48 + 0.001 * np.arange(5), rtol=1e-12)
        assert history.sampling_period_sec == 0.01
        assert any("in mV, as the file says" in line for line in report.sentences()) == (y == "V")


def test_tables_of_libraries(tmp_path: Path) -> None:
    """Spreadsheets, HDF5, netCDF and MAT files hold what their libraries wrote."""
    openpyxl, h5py = pytest.importorskip("openpyxl"), pytest.importorskip("h5py")
    scipy = pytest.importorskip("scipy.io")
    t, V = 0.01 * np.arange(20), np.round(48 + np.sin(np.arange(20.0)), 6)
    book = openpyxl.Workbook()
    for row in (["t", "V"], *zip(t.tolist(), V.tolist(), strict=True)):
        book.active.append(row)
    book.save(tmp_path / "lab.xlsx")
    with h5py.File(tmp_path / "lab.h5", "w") as out:
        out["t"], out["V"] = t, V
    scipy.savemat(tmp_path / "lab.mat", {"t": t, "V": V})
    (tmp_path / "cut.mat").write_bytes((tmp_path / "lab.mat").read_bytes()[:200])
    with pytest.raises(BagError, match="cannot be read as MAT"):
        open_table(tmp_path / "cut.mat")
    with scipy.netcdf_file(tmp_path / "lab.nc", "w") as out:
        out.createDimension("n", 20)
        for name, values in (("t", t), ("V", V)):
            out.createVariable(name, "d", ("n",))[:] = values
    for name in ("lab.xlsx", "lab.h5", "lab.mat", "lab.nc"):
        found = read_columns(open_table(tmp_path / name), ["t", "V"])
        np.testing.assert_array_equal(found["t"], t, err_msg=name)
        np.testing.assert_array_equal(found["V"], V, err_msg=name)
    with h5py.File(tmp_path / "lab.h5", "a") as out:
        out["cube"], out["name"], out["both"] = np.zeros((2, 3, 4)), "lab", np.stack([t, V], axis=1)
    scipy.savemat(
        tmp_path / "lab.mat", {"t": t, "cube": np.zeros((2, 3, 4)), "name": "lab", "s": {"V": V, "gain": 2.0}}
    )
    for name, known in (("lab.h5", ["V", "both[0]", "both[1]", "t"]), ("lab.mat", ["s.V", "t"])):
        table = open_table(tmp_path / name)
        assert sorted(one.name for one in table.columns) == known
        (note,) = table.notes
        assert note.startswith(f"{name}: left out: ")
        assert "cube (3 dimensions)" in note
        assert "name (no numbers)" in note
    (tmp_path / "lab.pkl").write_bytes(b"x")
    with pytest.raises(BagError, match="not supported: a pickle runs code"):
        open_table(tmp_path / "lab.pkl")


def test_columns_of_parquet_and_records(tmp_path: Path) -> None:
    """Times of every kind are instants, decimals numbers, lists and structures no numbers; records are columns."""
    k = np.arange(20)
    V = np.round(48 + np.sin(k), 6)
    instants = {
        "time32": pa.array((k * 10).astype(np.int32), pa.time32("ms")),
        "time64": pa.array(k * 10_000, pa.time64("us")),
        "duration": pa.array(k * 10, pa.duration("ms")),
        "timestamp": pa.array(k * 10, pa.timestamp("ms", tz="Europe/Berlin")),
    }
    columns = {
        **instants,
        "V": pa.array([Decimal(str(one)) for one in V]),
        "small": pa.array(V.astype(np.float16)),
        "list": pa.array([[one] for one in V]),
        "structure": pa.array([{"a": one} for one in V]),
    }
    pq.write_table(pa.table(columns), tmp_path / "lab.parquet")
    table = open_table(tmp_path / "lab.parquet")
    kinds = {one.name: one.kind for one in table.columns}
    assert kinds == {
        **dict.fromkeys(instants, ColumnKind.TIME),
        **dict.fromkeys(("V", "small"), ColumnKind.NUMBER),
        **dict.fromkeys(("list", "structure"), ColumnKind.TEXT),
    }
    found = read_columns(table, [*instants, "V"])
    for name in instants:
        assert found[name].tolist() == (k * 10_000_000).tolist(), name
    np.testing.assert_array_equal(found["V"], V)
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "lab.h5", "w") as out:
        out["run"] = np.array(list(zip(0.01 * k, V, strict=True)), dtype=[("t", "f8"), ("V [mV]", "f8")])
    table = open_table(tmp_path / "lab.h5")
    assert [(one.name, one.unit) for one in table.columns] == [("run.t", ""), ("run.V [mV]", "mV")]
    np.testing.assert_array_equal(read_columns(table, ["run.V [mV]"])["run.V [mV]"], V)


def test_household(tmp_path: Path) -> None:
    """A table of a household as a public repository has it: a missing minute is not delivered, attacks are labelled."""
    lines = ["Date;Time;Global_active_power;Voltage;Global_intensity"]
    for minute in range(300):
        cells = "?;?;?" if minute == 70 else f"4.2;{240 + math.sin(minute):.3f};{18 + math.cos(minute):.3f}"
        lines.append(f"16/12/2006;{17 + minute // 60}:{minute % 60:02d}:00;{cells}")
    file = tmp_path / "household_power_consumption.txt"
    file.write_text("\n".join(lines) + "\n")
    y = ["Voltage", "Global_intensity"]
    attack = {"kind": "bias", "link": "1-2", "bias": [5.0, 0.0, 0.0], "start_sec": 6000.0}
    mapping = mapping_of(
        {
            "histories": [{"dgu": 1, "y": y}],
            "streams": [{"link": "1-2", "y": y}],
            "attacks": [attack],
            "sampling_period_sec": 60,
        },
        "test",
    )
    import_histories(file, mapping, tmp_path / "history")
    report = import_streams(file, mapping, tmp_path / "out", tmp_path / "history")
    record = read_run(tmp_path / "out")
    assert np.flatnonzero(~record.delivered[:, 0]).tolist() == [70]
    assert report.missing == 1
    true = np.array([240 + round(math.sin(minute), 3) for minute in range(300)])
    off = record.received[:, 0, 0] - true
    np.testing.assert_allclose(np.delete(off, 70), np.delete(np.where(np.arange(300) >= 100, 5.0, 0.0), 70), atol=1e-9)
    assert [(one.step, one.kind) for one in record.events] == [(100, "bias")]
