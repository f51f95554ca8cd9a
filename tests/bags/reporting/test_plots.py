"""Pictures of a run."""

from dataclasses import replace
from pathlib import Path

from bags.reporting.outline import outline_of
from bags.reporting.plots import draw, draw_residuals, draw_states
from bags.runs.run_record import RunRecord

PNG = b"\x89PNG\r\n\x1a\n"


def test_two_pictures(record: RunRecord, tmp_path: Path) -> None:
    """A run is drawn as states and residuals."""
    files = draw(record, tmp_path / "plots")
    assert [file.name for file in files] == ["states.png", "residuals.png"]
    assert all(file.read_bytes().startswith(PNG) for file in files)


def test_nothing_to_draw(record: RunRecord, tmp_path: Path) -> None:
    """A run without a complete step has no pictures and makes no folder."""
    names = ["x", "alpha", "alarm", "phase", "residual", "threshold"]
    empty = replace(record, steps=0, **{name: getattr(record, name)[:0] for name in names})
    assert draw(empty, tmp_path / "plots") == ()
    assert not (tmp_path / "plots").exists()


def test_attacked_panel_stands_out(record: RunRecord) -> None:
    """Each link has a panel; the attacked ones say so and are shaded, the first alarm is marked."""
    panels = {axes.get_title(): axes for axes in draw_residuals(outline_of(record)).axes}
    assert list(panels) == ["2 → 1", "3 → 1   attacked", "1 → 2   attacked", "1 → 3"]
    assert len(panels["1 → 2   attacked"].patches) == 1
    assert len(panels["1 → 3"].patches) == 0
    markers = [line.get_marker() for line in panels["1 → 2   attacked"].lines]
    assert markers.count("v") == 1


def test_refused_link_says_so(record: RunRecord) -> None:
    """A link that is not monitored has no curves but a word."""
    refused = {link: replace(design, accepted=False) for link, design in record.designs.items()}
    first = draw_residuals(outline_of(replace(record, designs=refused))).axes[0]
    assert [text.get_text() for text in first.texts] == ["not monitored"]
    assert not first.lines


def test_states_show_every_dgu(record: RunRecord) -> None:
    """Voltage has a line for each DGU and one for the mean; currents and corrections one for each DGU."""
    assert [len(axes.lines) for axes in draw_states(outline_of(record)).axes] == [4, 3, 3]
