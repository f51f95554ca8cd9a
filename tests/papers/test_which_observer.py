"""The study of which observer to use when."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from dcmg.papers import which_observer
from monitor import input_estimators, observers

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(scope="module")
def result() -> which_observer.WhichResult:
    """The study."""
    return which_observer.run()


def test_what_the_docs_say_about_detection_holds(result: which_observer.WhichResult) -> None:
    """With three outputs T's observer sees every bias; with two, only the reconstructed input shows one on V."""
    assert not [check for check in which_observer.checks(result) if not check.ok]
    rows = {row.name: row for row in result.rows}
    assert np.all(np.isfinite(rows["full_order, y = x"].detection))
    assert np.all(np.isnan(rows["delayed 1, y = (V, I_t)"].detection))
    assert np.isfinite(rows["inputs by delayed, y = (V, I_t)"].detection[0])


def test_every_kind_of_the_registries_has_its_row(result: which_observer.WhichResult) -> None:
    """A new observer or estimator belongs into the study; the team costs the most numbers a step."""
    names = " ".join(row.name for row in result.rows)
    assert all(kind in names for kind in (*observers.KINDS, *input_estimators.KINDS))
    assert max(result.rows, key=lambda row: row.heard).name.startswith("distributed")
    assert np.all(np.isfinite(result.rows[-1].detection))


def test_table_and_figure_are_written(result: which_observer.WhichResult, tmp_path: Path) -> None:
    """One line a method in the table, one PNG."""
    assert which_observer.table(result).count("\n") == len(result.rows) + 1
    (path,) = which_observer.plot(result, tmp_path)
    assert path.read_bytes().startswith(b"\x89PNG")
