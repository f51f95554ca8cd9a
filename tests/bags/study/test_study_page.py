"""The page and the pictures of a study."""

import re
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from matplotlib.figure import Figure
from pyarrow import parquet

from bags.study import LocalPool, Study, StudyCell, compare, load_study, operating_points, run_study
from bags.study.figures import QUANTITIES, draw_panel, handles_of, lines_of
from bags.study.page import write_page


@pytest.fixture(name="table", scope="module")
def _table(tmp_path_factory: pytest.TempPathFactory, tiny_cells: tuple[StudyCell, ...]) -> pa.Table:
    return parquet.read_table(run_study(tiny_cells, tmp_path_factory.mktemp("page"), LocalPool(1)))


@pytest.fixture(name="tiny_cells", scope="module")
def _tiny_cells(tiny_file: Path) -> tuple[StudyCell, ...]:
    from bags.study import cells_of  # noqa: PLC0415
    from dcmg.shipped import scenario_path  # noqa: PLC0415

    return cells_of(load_study(tiny_file), "tiny.yaml", scenario_path)


def test_every_cell_has_its_curves(table: pa.Table, tiny: Study, tmp_path: Path) -> None:
    """The matrix has a cell for each attack, observer and detector, each leads to curves, and nothing is fetched."""
    points = operating_points([table])
    text = write_page(tiny, points, compare(points, 1e-2), tmp_path).read_text(encoding="utf-8")
    cells = re.findall(r'<a href="#([\w-]+)" data-line="(\d)">', text)
    assert len(cells) == 2 * 2
    for name, line in cells:
        number = name.removeprefix("attack-")
        assert f'id="{name}"' in text
        for quantity in QUANTITIES:
            assert f"curve-{number}-{quantity}-{line}" in text
    assert not re.findall(r'<(?:script|img|link)[^>]+(?:src|href)="(?!#)', text)
    identifiers = [one for one in re.findall(r' id="([^"]+)"', text) if "curve-" not in one.split("_")[-1]]
    assert len(identifiers) == len(set(identifiers))


@pytest.mark.parametrize("name", list(QUANTITIES))
def test_axes_have_units_and_no_negative_times(table: pa.Table, name: str) -> None:
    """Every label ends in a unit, a 0 has its place, no axis goes below it, and no point lies outside."""
    points = [one for one in operating_points([table]) if one.attack == "bias"]
    axes = Figure().subplots()
    draw_panel(axes, points, name, lines_of(points))
    assert re.search(r"\[\w+\]$", QUANTITIES[name][1])
    assert axes.get_xticklabels()[0].get_text() == "0"
    assert min(axes.get_ylim()) >= 0.0
    assert min(axes.get_xlim()) > 0.0
    (low, high), (least, most) = axes.get_xlim(), axes.get_ylim()
    for line in axes.lines:
        x, y = np.asarray(line.get_xdata(), dtype=np.float64), np.asarray(line.get_ydata(), dtype=np.float64)
        assert ((low <= x) & (x <= high)).all()
        assert (np.isnan(y) | ((least <= y) & (y <= most))).all()


def test_points_on_one_spot_are_all_seen(table: pa.Table) -> None:
    """Marks are hollow and of different sizes: three observers that detect at once show three of them."""
    handles = handles_of(lines_of(operating_points([table])))
    assert len({one.get_markersize() for one in handles}) == len(handles)
    assert {one.get_markerfacecolor() for one in handles} == {"none"}
