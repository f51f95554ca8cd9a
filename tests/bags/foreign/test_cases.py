"""The founders' cases, one small input for each kind that lost, swapped or misled; skipped where they are absent."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from bags.foreign.importing import ImportReport, import_histories, import_streams
from bags.foreign.mapping import mapping_of
from bags.foreign.outline import describe_source
from bags.mcap.errors import BagError
from bags.runs.reader import read_run
from bags.watch.histories import read_histories

CASES = Path(__file__).parents[4] / "shared" / "cases"
BAGS, TABLES = CASES / "bags", CASES / "tables"
pytestmark = pytest.mark.skipif(not CASES.is_dir(), reason="the founders' cases are not here")
K = np.arange(100)
X = 48 + np.sin(0.37 * K) + 0.3 * np.sin(1.3 * K)


def _history(source: Path, out: Path, *fields: str, **keys: object) -> tuple[NDArray[np.float64], ImportReport]:
    report = import_histories(source, mapping_of({"histories": [{"dgu": 1, "y": list(fields)}], **keys}, "test"), out)
    return np.concatenate([one.y for one in read_histories(out, 1)]), report


def test_two_definitions_of_one_type_are_both_read(tmp_path: Path) -> None:
    """Each channel is read by its own definition: nothing is swapped."""
    for topic in ("/old", "/new"):
        y, _ = _history(BAGS / "b1_swapped.mcap", tmp_path / topic[1:], f"{topic}.v", f"{topic}.i")
        assert len(y) == 100
        assert np.all(np.abs(y[:, 0] - 48) < 1.4)
        assert np.all(np.abs(y[:, 1] - 2) < 0.6)


@pytest.mark.parametrize(
    "name",
    ["split_qos_mcap", "a1_mcap_zeroed", "a3_chunkonly", "a5_noschema", "a8_mcap_message", "a24_srv", "wal_half"],
)
def test_every_message_is_read(tmp_path: Path, name: str) -> None:
    """Other QoS, no index, no schema, compressed messages, a write-ahead log: 100 of 100, with the right numbers."""
    before = {one.name: one.read_bytes() for one in (BAGS / name).iterdir()}
    y, _ = _history(BAGS / name, tmp_path / "out", "/a.vector.x")
    np.testing.assert_allclose(y[:, 0], X, rtol=0, atol=1e-12)
    (a, *others) = describe_source(BAGS / name).topics
    assert (a.name, a.messages, a.unreadable) == ("/a", 100, "")
    assert [one.name for one in others if one.unreadable] == (["/set/_service_event"] if name == "a24_srv" else [])
    assert {one.name: one.read_bytes() for one in (BAGS / name).iterdir()} == before


def test_what_inspect_prints_is_what_history_takes(tmp_path: Path) -> None:
    """A topic without a leading slash."""
    (one,) = describe_source(BAGS / "a23_noslash").topics
    assert "battery.vector.x" in one.fields
    y, _ = _history(BAGS / "a23_noslash", tmp_path / "out", "battery.vector.x")
    np.testing.assert_allclose(y[:, 0], X, rtol=0, atol=1e-12)


def test_two_columns_of_one_name_are_refused(tmp_path: Path) -> None:
    """Never the last one."""
    with pytest.raises(BagError, match="2 columns are called 'V'"):
        _history(TABLES / "dupcols.csv", tmp_path / "out", "V", time="t")


@pytest.mark.parametrize(
    "name",
    [
        "semicolon_decimal_comma.csv",
        "plain.tsv",
        "units_row.csv",
        "iso_tz.csv",
        "missing_dashes.csv",
        "datetime.parquet",
    ],
)
def test_tables_as_people_write_them(tmp_path: Path, name: str) -> None:
    """Separators, decimal commas, units, times, dashes for what is missing: 60 samples with the numbers of the case."""
    y, report = _history(TABLES / name, tmp_path / "out", "V", time="t")
    missing = np.flatnonzero(np.isnan(y[:, 0]))
    assert len(missing) == report.missing == (1 if name == "missing_dashes.csv" else 0)
    there = np.isfinite(y[:, 0])
    np.testing.assert_allclose(y[there, 0], X[:60][there], rtol=0, atol=1e-6)
    assert report.grids["histories.0"].period_ns == 10_000_000


def test_blank_cell_is_a_sample_that_did_not_arrive(tmp_path: Path) -> None:
    """Counted, told, and not delivered."""
    mapping = mapping_of({"streams": [{"link": "1-2", "y": ["V", "I", "v"]}], "time": "t"}, "test")
    report = import_streams(TABLES / "field_blank_all.csv", mapping, tmp_path / "out")
    delivered = read_run(tmp_path / "out").delivered
    lines = (TABLES / "field_blank_all.csv").read_text().splitlines()[1:]
    np.testing.assert_array_equal(delivered[:, 0], ["" not in line.split(",") for line in lines])
    assert report.missing == int((~delivered).sum()) > 0
    assert any("I: 500 samples are no finite numbers" in one for one in report.sentences())


def test_slower_column_is_bridged_up_to_a_stated_length(tmp_path: Path) -> None:
    """Without a length that suffices the refusal says which would."""
    with pytest.raises(
        BagError, match=r"I comes every 0.05 s, hold bridges at most 0.015 s: expected .*max-gap. of 0.05"
    ):
        _history(TABLES / "two_rates.csv", tmp_path / "no", "V", "I", time="t", sampling={"policy": "hold"})
    for policy in ("hold", "linear"):
        sampling = {"policy": policy, "max_gap_sec": 0.051}
        y, _ = _history(TABLES / "two_rates.csv", tmp_path / policy, "V", "I", time="t", sampling=sampling)
        assert np.isfinite(y).all()
        np.testing.assert_allclose(y[:, 0], X[: len(y)], rtol=0, atol=1e-4)
