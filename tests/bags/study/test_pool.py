"""Processes of a study that are killed or stopped cost a retry and no result; the table can be larger than memory."""

import os
import signal
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from weakref import ref

import pyarrow as pa
import pyarrow.dataset
import pytest
from pyarrow import parquet

from bags.study import (
    LocalPool,
    Study,
    StudyCell,
    StudyError,
    cells_of,
    compare,
    operating_points,
    plan_of,
    run_study,
    tables_of,
)
from bags.study.evaluate import SCHEMA, evaluate
from bags.study.parts import as_part
from dcmg.shipped import scenario_path
from tests.bags.study.trees import bytes_of


@pytest.fixture(name="short")
def _short(cells: tuple[StudyCell, ...]) -> tuple[StudyCell, ...]:
    """Four cells: two observers, two blocks of two seeds."""
    return tuple(replace(one, seeds=seeds) for one in cells for seeds in ((1, 2), (3, 4)))


@pytest.fixture(name="sound")
def _sound(short: tuple[StudyCell, ...], tmp_path: Path) -> dict[str, bytes]:
    """The table of a study that nothing happens to."""
    return bytes_of(run_study(short, tmp_path / "sound", LocalPool(2)))


def _hit(folder: Path, number: signal.Signals, *, always: bool = False) -> Callable[[StudyCell], pa.Table]:
    """An evaluation whose process is hit by a signal in the first try of each cell."""

    def hit(cell: StudyCell) -> pa.Table:
        mark = folder / cell.key
        if always or not mark.exists():
            mark.touch()
            os.kill(os.getpid(), number)
        return evaluate(cell)

    return hit


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_lost_process_costs_a_retry_and_no_result(
    number: signal.Signals,
    short: tuple[StudyCell, ...],
    sound: dict[str, bytes],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Every cell's process is killed, or stopped for ever, once: the same bytes, and each loss is said."""
    monkeypatch.setattr("bags.study.pool.evaluate", _hit(tmp_path, number))
    monkeypatch.setattr("bags.study.pool._LOOK_SEC", 0.05)
    said: list[str] = []
    assert bytes_of(run_study(short, tmp_path / "out", LocalPool(2), say=said.append)) == sound
    assert [line.rpartition(": its")[2] for line in said] == [" process was killed: computed again"] * len(short)


def test_a_cell_that_always_kills_its_process_is_given_up(
    short: tuple[StudyCell, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Four times, then one line; what was done stays."""
    run_study(short[:1], tmp_path, LocalPool(1))
    monkeypatch.setattr("bags.study.pool.evaluate", _hit(tmp_path, signal.SIGKILL, always=True))
    with pytest.raises(StudyError, match="its seeds 3 to 4 was killed 4 times, expected enough memory"):
        run_study(short, tmp_path, LocalPool(1))
    assert len(list((tmp_path / "parts").glob("*.parquet"))) == 1


def test_the_table_is_one_data_set(short: tuple[StudyCell, ...], tmp_path: Path) -> None:
    """Any reader takes the folder as one table: of this study alone, in its order, whatever else was computed there."""
    run_study([replace(short[0], condition="another"), *short], tmp_path, LocalPool(2))
    folder = run_study(short, tmp_path, LocalPool(2))
    whole = parquet.read_table(folder)
    assert whole.schema.remove_metadata() == SCHEMA
    assert whole.num_rows == sum(table.num_rows for table in tables_of(folder)) == 2 * 2 * 3 * 4 * 14
    assert list(dict.fromkeys(whole["observer"].to_pylist())) == ["data-driven", "model-based"]
    few = pa.dataset.dataset(folder).to_table(columns=["seed"], filter=pa.dataset.field("seed") == 3)
    assert few.num_rows == whole.num_rows // 4
    assert len(list((tmp_path / "parts").glob("*.parquet"))) == 5
    assert sorted(path.name for path in tmp_path.iterdir()) == ["parts", "table"]


def test_blocks_are_summed_up_as_one_table_and_one_at_a_time(
    cells: tuple[StudyCell, ...], short: tuple[StudyCell, ...], tmp_path: Path
) -> None:
    """The comparison of a study in blocks is that of the whole, and no more than two tables are ever alive."""
    whole = operating_points([pa.concat_tables([evaluate(one) for one in cells])])
    folder, given, most = run_study(short, tmp_path, LocalPool(2)), list[ref[pa.Table]](), 0

    def counted() -> Iterator[pa.Table]:
        nonlocal most
        for table in tables_of(folder):
            given.append(ref(table))
            most = max(most, sum(one() is not None for one in given))
            yield table

    parts = operating_points(counted())
    assert most <= 2
    assert [repr(one.row()) for one in parts] == [repr(one.row()) for one in whole]
    assert repr(compare(parts, 1e-2)) == repr(compare(whole, 1e-2))


def test_a_file_in_the_place_of_the_table_is_refused(short: tuple[StudyCell, ...], tmp_path: Path) -> None:
    """It is somebody's."""
    (tmp_path / "table").write_text("mine")
    with pytest.raises(StudyError, match="table: is no folder, expected"):
        run_study(short[:1], tmp_path, LocalPool(1))


def test_a_plan_counts_what_is_done(cells: tuple[StudyCell, ...], tiny: Study) -> None:
    """Cells, run-steps and bytes are those of the study, and twice the seeds have twice the steps."""
    plan = plan_of(cells)
    rows = dict(plan.rows(2))
    assert (rows["cells"], plan.run_steps) == ("2", 2 * 3 * 4 * 400)
    assert plan.table_bytes == sum(len(as_part(one.key, evaluate(one))) for one in cells)
    assert 0.0 < plan.collector_sec < plan.worker_sec
    twice = {"attacks": [{"name": one.name, **one.attack} for one in tiny.attacks], "seeds": 8}
    more = cells_of(Study.model_validate({**tiny.model_dump(), **twice}), "tiny.yaml", scenario_path)
    assert plan_of(more).run_steps == 2 * plan.run_steps
