"""An hour of twenty topics is imported in bounded memory: of a message only its stamp stays."""

import gc
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin

from bags.foreign import gridding, importing, spill
from bags.foreign.gridding import put_on_grid
from bags.foreign.importing import import_histories
from bags.foreign.mapping import mapping_of
from bags.foreign.recordings import read_recordings
from bags.foreign.spill import SpilledRows
from bags.watch.histories import read_histories
from dcmg.measures.import_memory import import_memory

T = 10_000_000
FIELDS = [f"/{topic}.data[{number}]" for topic in "ab" for number in range(6)]
_BYTES_A_STAMP = 8


def _peak(bag: Path) -> int:
    """Largest number of bytes in use while a bag is read and put on a grid, block by block."""
    mapping = mapping_of({"streams": [{"link": "1-2", "y": FIELDS}]}, "test")
    gc.collect()
    gc.freeze()  # what other tests left behind does not put off the collection of what is read
    tracemalloc.start()
    try:
        read = read_recordings(bag, FIELDS, mapping)
        grid = put_on_grid(bag, read.recordings, mapping.sampling, T, common=False)
        assert sum(len(block.values) for block in grid.blocks()) == grid.rows
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
        gc.unfreeze()


def test_only_the_stamps_grow_with_the_recording(
    write_arrays: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Four times as many messages cost their stamps and what sorting and looking at them takes, not their values."""
    monkeypatch.setattr(spill, "_KEPT", 1000)
    monkeypatch.setattr(gridding, "_AT_ONCE", 500)
    monkeypatch.setattr(gridding, "_BLOCK", 500)
    peaks: list[int] = []
    for count in (1000, 1000, 4000):  # the first time modules and definitions are read
        bag = write_arrays(
            {f"/{name}": ([k * T for k in range(count)], [[float(k)] * 6 for k in range(count)]) for name in "ab"},
            storage=StoragePlugin.SQLITE3,  # MCAP holds a chunk of a megabyte besides
            name=f"bag_{count}_{len(peaks)}",
        )
        peaks.append(_peak(bag))
    grown = (peaks[2] - peaks[1]) / (2 * 3000)
    assert grown < 5 * _BYTES_A_STAMP  # twelve numbers of 8 bytes would be kept otherwise


def test_rows_on_disk_are_those_that_were_appended(monkeypatch: pytest.MonkeyPatch) -> None:
    """In any order, near and far, on disk and in memory."""
    monkeypatch.setattr(spill, "_KEPT", 64)
    rows, there = SpilledRows(3), np.arange(3000.0).reshape(-1, 3)
    for row in there.tolist():
        rows.append(row)
    generator = np.random.default_rng(5)
    for indices in (np.arange(1000), np.arange(1000)[::-1], generator.permutation(1000), np.array([999, 0, 0, 500])):
        np.testing.assert_array_equal(rows[indices], there[indices])
    assert rows[np.empty(0, dtype=np.intp)].shape == (0, 3)


def test_long_experiments_are_cut_where_a_message_would_be_too_large(
    write_arrays: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every sample is there once, in order, and no piece is larger than a message may be."""
    monkeypatch.setattr(importing, "_MOST_BYTES", 16 * 40)  # 40 rows of an output that is the state
    rows = [[float(k)] for k in range(130)]
    bag = write_arrays({"/a": ([k * T for k in range(130)], rows)}, name="long")
    mapping = mapping_of({"histories": [{"dgu": 1, "y": ["/a.data[0]"]}]}, "test")
    report = import_histories(bag, mapping, tmp_path / "out")
    pieces = read_histories(tmp_path / "out", 1)
    assert report.experiments == {1: 4}
    assert [len(one.y) for one in pieces] == [32, 33, 33, 32]
    np.testing.assert_array_equal(np.concatenate([one.y for one in pieces]), rows)


def test_measurement_of_the_docs(tmp_path: Path) -> None:
    """`dcmg measure import` imports what it has written, in three processes; at a small size."""
    found = import_memory(tmp_path, (200, 3), 100, 300.0, lambda _: None)
    assert found.passed
    assert [one.command for one in found.imports] == ["inspect", "history", "stream"]
    assert all(20 < one.peak_mb < 300 for one in found.imports)
    (history,) = read_histories(tmp_path / "history", 1)
    np.testing.assert_allclose(history.y[:, 2], 50 + np.arange(200) * 5 % 997 * 1e-3)
