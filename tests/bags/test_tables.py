"""Tables from outside as histories."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from bags.check import check
from bags.convert import history_of
from bags.errors import BagError
from bags.histories import read_histories
from bags.run_record import RunRecord
from bags.tables import Column, TableMapping, import_history, read_history_table
from dcmg_bringup.import_commands import app

Y = tuple(Column.parse(text) for text in ("V", "mA*0.001", "v"))


def _csv(path: Path, time_sec: list[float], values: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> Path:
    lines = ["t_ms,V,mA,v"]
    rows = zip(time_sec, values.tolist(), strict=True)
    lines += [f"{time * 1000!r},{V!r},{current * 1000!r},{v!r}" for time, (V, current, v) in rows]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_history_of_a_table(record: RunRecord, tmp_path: Path) -> None:
    """A recorded experiment, written as a table in other units, comes back as the same history."""
    original = next(one for one in record.histories if one.dgu == 1)
    file = _csv(tmp_path / "lab.csv", [0.01 * row for row in range(len(original.y))], original.y)
    mapping = TableMapping(y=Y, time=Column.parse("t_ms*0.001"))
    report = import_history(file, 1, mapping, tmp_path / "bag")
    assert (report.gaps, report.dropped, len(report.records)) == ((), 0, 1)
    assert check(tmp_path / "bag").clean
    (found,) = read_histories(tmp_path / "bag", 1)
    # times 1000 and back costs a rounding or two
    np.testing.assert_allclose(found.y, original.y, rtol=1e-15, atol=1e-15)
    assert found.sampling_period_sec == pytest.approx(0.01, rel=1e-12)
    assert history_of([found]).experiments[0].u.shape == (len(original.y), 0)


def test_gaps_cut_the_history(tmp_path: Path) -> None:
    """Where whole samples are missing, a new experiment starts; a sample on its own is left out."""
    steps = [0, 1, 2, 5, 6, 9, 12, 13]
    values = np.arange(24.0).reshape(8, 3)
    file = _csv(tmp_path / "lab.csv", [0.01 * step for step in steps], values)
    mapping = TableMapping(y=Y, time=Column.parse("t_ms*0.001"))
    report = read_history_table(file, 2, mapping)
    assert [row for row, _ in report.gaps] == [3, 5, 6]
    assert [length for _, length in report.gaps] == pytest.approx([0.03, 0.03, 0.03])
    assert [one.y[:, 0].tolist() for one in report.records] == [[0.0, 3.0, 6.0], [9.0, 12.0], [18.0, 21.0]]
    assert {one.experiments for one in report.records} == {3}
    assert report.dropped == 1


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("t,V\n0,1\n0.01,2\n0.024,3\n0.03,4\n", "irregular sampling, 2 of 3 steps are no multiple of 0.01 s"),
        ("t,V\n0,1\n0,2\n0,3\n", "steps by 0 s, expected ascending instants"),
        ("t,V\n0,1\n", "holds 1 rows, expected two consecutive samples"),
        ("t,V\n0,1\n1,x\n", "column V holds something besides numbers"),
        ("t,V\n0,1\n1,nan\n", "column V holds nan in row 1"),
        ("t,V\n0,1\n1\n", "row 1 has 1 cells, expected 2"),
        ("t,W\n0,1\n1,2\n", "has no column 'V', found t, W"),
        ("", "has no column 'V', found"),
    ],
)
def test_tables_that_are_none(tmp_path: Path, text: str, what: str) -> None:
    """Irregular sampling, missing columns and what is no number are one line each."""
    file = tmp_path / "lab.csv"
    file.write_text(text)
    mapping = TableMapping(y=(Column(name="V"),), time=Column(name="t"), sampling_period_sec=None)
    if "irregular" in what:
        mapping = TableMapping(y=(Column(name="V"),), time=Column(name="t"), sampling_period_sec=0.01)
    with pytest.raises(BagError, match=what) as error:
        import_history(file, 1, mapping, tmp_path / "bag")
    assert "\n" not in str(error.value)
    with pytest.raises(BagError, match="expected a name, or name\\*factor"):
        Column.parse("a*1e")


def test_parquet(tmp_path: Path) -> None:
    """Parquet is read as CSV is; without a time column the sampling period must be given."""
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    parquet.write_table(arrow.table({"V": [1.0, 2.0, 3.0]}), tmp_path / "lab.parquet")
    mapping = TableMapping(y=(Column(name="V"),), sampling_period_sec=0.01)
    (one,) = read_history_table(tmp_path / "lab.parquet", 1, mapping).records
    assert (one.y.tolist(), one.x.tolist()) == ([[1.0], [2.0], [3.0]], [[1.0], [2.0], [3.0]])
    with pytest.raises(BagError, match="expected a positive sampling period instead"):
        read_history_table(tmp_path / "lab.parquet", 1, TableMapping(y=(Column(name="V"),)))
    (tmp_path / "bad.parquet").write_text("nothing")
    with pytest.raises(BagError, match="is no Parquet file"):
        read_history_table(tmp_path / "bad.parquet", 1, mapping)


def test_command(tmp_path: Path) -> None:
    """The command takes columns with factors and tells gaps."""
    file = _csv(tmp_path / "lab.csv", [0.0, 0.01, 0.02, 0.05, 0.06], np.ones((5, 3)))
    columns = ["--y", "V", "--y", "mA*0.001", "--y", "v", "--time", "t_ms*0.001", "--dgu", "1"]
    done = CliRunner().invoke(app, ["history", str(file), *columns, "--out", str(tmp_path / "bag")])
    assert done.exit_code == 0, done.output
    assert "gap of 0.03 s before row 3" in done.output
    assert "5 samples in 2 experiments of DGU 1" in done.output
