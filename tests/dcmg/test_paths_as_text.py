"""Whoever works in Python gives paths as text, too: nothing but a one-line error for one that leads nowhere."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from bags.foreign.mapping import load_mapping
from bags.golden.runs import golden_path
from bags.mcap.bag import open_bag
from bags.mcap.check import check
from bags.mcap.errors import BagError
from bags.mcap.repair import repair
from bags.runs.played import open_source
from bags.runs.reader import open_run, read_run
from bags.runs.replay import replay
from bags.sources.contents import contents
from bags.study import load_study
from bags.study.errors import StudyError
from bags.tables.export import export
from bags.tables.table_format import TableFormat
from bags.tables.tabular import dataset
from bags.watch.carried import read_carried
from bags.watch.histories import read_all_histories
from bags.watch.scenarios import load_scenario
from dcmg.shipped import scenario_path
from dgu_sim.errors import ScenarioError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

BAG = golden_path("biased")
READERS: list[tuple[Callable[[str], object], Path | None]] = [
    (load_scenario, scenario_path("gallo_six_dgu")),
    (load_study, None),
    (load_mapping, None),
    (open_run, BAG),
    (read_run, BAG),
    (open_bag, BAG),
    (check, BAG),
    (dataset, BAG),
    (replay, BAG),
    (contents, BAG),
    (open_source, BAG),
    (read_carried, BAG),
    (read_all_histories, BAG),
    (lambda path: repair(path, f"{path}-repaired"), None),
    (lambda path: export(path, f"{path}-tables", TableFormat.CSV), None),
]


@pytest.mark.parametrize(("read", "there"), READERS)
def test_a_path_may_be_text(read: Callable[[str], object], there: Path | None, tmp_path: Path) -> None:
    """What exists is read; what does not is named in one line."""
    if there is not None:
        assert read(str(there)) is not None
    nowhere = str(tmp_path / "nowhere")
    with pytest.raises((BagError, ScenarioError, StudyError), match="nowhere") as caught:
        read(nowhere)
    assert "\n" not in str(caught.value)


def test_what_is_written_may_go_to_a_path_as_text(tmp_path: Path) -> None:
    """Repaired bags and tables, by the calls that a script makes."""
    assert repair(str(BAG), str(tmp_path / "repaired")).messages
    assert check(str(tmp_path / "repaired")).clean
    assert export(str(BAG), str(tmp_path / "tables"), TableFormat.CSV).files
