"""Pictures of a run."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from bags.reporting.ink import look
from bags.reporting.judged import judge
from bags.reporting.pictures import draw, draw_residuals, draw_states
from bags.reporting.timeline import gather
from bags.runs.run_record import RunRecord

PNG = b"\x89PNG\r\n\x1a\n"


def _residuals(record: RunRecord) -> Figure:
    timeline = gather([record], record.steps)
    return draw_residuals(timeline, judge(timeline))


def test_two_pictures(record: RunRecord, tmp_path: Path) -> None:
    """A run is drawn as states and residuals."""
    timeline = gather([record], record.steps)
    files = draw(timeline, judge(timeline), tmp_path / "plots")
    assert [file.name for file in files] == ["states.png", "residuals.png"]
    assert all(file.read_bytes().startswith(PNG) for file in files)


def test_nothing_to_draw(record: RunRecord, tmp_path: Path) -> None:
    """A run without a complete step has no pictures and makes no folder."""
    empty = record.rows(0, 0)
    timeline = gather([empty], 0)
    assert draw(timeline, judge(timeline), tmp_path / "plots") == ()
    assert not (tmp_path / "plots").exists()


def test_attacked_panel_stands_out(record: RunRecord) -> None:
    """Each link has a panel and one curve; attacked ones say so and are shaded, first alarms and calibration marked."""
    figure = _residuals(record)
    panels = {axes.get_title(): axes for axes in figure.axes}
    assert list(panels) == ["2 → 1", "3 → 1   attacked", "1 → 2   attacked", "1 → 3"]
    for axes in panels.values():
        curves = [line for line in axes.lines if len(np.asarray(line.get_xdata())) > 2]
        assert len(curves) == 1
        assert len(axes.collections) == 1  # settling and calibration
    assert len(panels["1 → 2   attacked"].patches) == 1
    assert len(panels["1 → 3"].patches) == 0
    markers = [line.get_marker() for line in panels["1 → 2   attacked"].lines]
    assert markers.count("v") == 1
    assert "threshold" in figure.get_supylabel()


def test_refused_link_says_so(record: RunRecord) -> None:
    """A link that is not monitored has no curves but a word."""
    refused = {link: replace(design, accepted=False) for link, design in record.designs.items()}
    first = _residuals(replace(record, designs=refused)).axes[0]
    assert [text.get_text() for text in first.texts] == ["not monitored"]
    assert not first.lines


def test_states_show_every_dgu_and_name_every_attack(record: RunRecord) -> None:
    """Voltage has a line for each DGU and one for the mean; currents and corrections one for each DGU."""
    timeline = gather([record], record.steps)
    axes = draw_states(timeline, judge(timeline)).axes
    assert [len(one.lines) for one in axes] == [4, 3, 3]
    assert [text.get_text().strip() for text in axes[0].texts] == ["bias on 1-2", "bias on 3-1"]


def test_curves_are_told_apart_without_colour() -> None:
    """The first eight DGUs have dashes of their own."""
    assert len({look(position)[1] for position in range(8)}) == 8
