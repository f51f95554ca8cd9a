"""Figures for papers: what publishers check, and that the figure shows the run."""

from __future__ import annotations

import re
import zlib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from matplotlib.patches import FancyArrowPatch

import dcmg
from bags.reporting.publication.choice import Kind
from bags.reporting.publication.make import save
from bags.reporting.publication.styles import STYLES, Column
from bags.reporting.timeline import gather

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bags.runs.run_record import RunRecord

PAGE = Path(__file__).parents[3] / "docs" / "figures.md"
KINDS = [one.value for one in Kind]


def _written(figure: Figure, path: Path) -> bytes:
    save(figure, path)
    return path.read_bytes()


@pytest.mark.parametrize("kind", KINDS)
def test_a_pdf_is_what_publishers_take(record: RunRecord, tmp_path: Path, kind: str) -> None:
    """As wide as a column, TrueType fonts embedded and no Type 3, vectors alone, the same bytes each time."""
    figure = dcmg.plot(record, kind)
    pdf = _written(figure, tmp_path / "a.pdf")
    box = re.search(rb"/MediaBox \[ ?0 0 ([\d.]+) ([\d.]+) ?\]", pdf)
    assert box is not None
    assert abs(float(box[1]) / 72.0 - 3.5) < 0.01
    assert float(box[2]) / 72.0 <= STYLES["ieee"].tallest
    assert b"/FontFile2" in pdf
    assert b"/Type3" not in pdf
    assert b"/Subtype /Image" not in pdf
    assert b"CreationDate" not in pdf
    assert pdf == _written(dcmg.plot(record, kind), tmp_path / "b.pdf")


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("column", Column)
def test_a_figure_is_as_wide_as_the_column_and_all_of_it_is_on_the_page(
    record: RunRecord, style: str, column: Column
) -> None:
    """In every style and width; its letters are those of the style, and of at least 5 pt."""
    for kind in KINDS:
        figure = dcmg.plot(record, kind, style=style, column=column.value)
        width, height = figure.get_size_inches()
        assert width == STYLES[style].width(column)
        assert height <= STYLES[style].tallest
        drawn = figure.get_tightbbox()
        assert min(drawn.x0, drawn.y0) > -0.02
        assert drawn.x1 < width + 0.02
        assert drawn.y1 < height + 0.02
        texts = [text for axes in figure.axes for text in (axes.xaxis.label, axes.yaxis.label, axes.title)]
        assert {text.get_fontfamily()[0] for text in texts} == {STYLES[style].fonts[0]}
        assert min(float(text.get_fontsize()) for text in texts) >= 5.0


def test_svg_and_png(record: RunRecord, tmp_path: Path) -> None:
    """An SVG needs no font and holds no picture; the same figure gives the same bytes in every format."""
    figure = dcmg.plot(record, "roc", out=tmp_path / "roc.svg")
    svg = (tmp_path / "roc.svg").read_bytes()
    assert b"<text" not in svg
    assert b"<image" not in svg
    assert svg == _written(dcmg.plot(record, "roc"), tmp_path / "b.svg")
    assert _written(figure, tmp_path / "a.png") == _written(figure, tmp_path / "b.png")


def test_curves_are_those_of_the_run(record: RunRecord) -> None:
    """The components of one link's residual, in the time that was asked for, with units, told apart without colour."""
    figure = dcmg.plot(record, "components", links=["1-2"], start_sec=0.9, stop_sec=1.2)
    at = record.links.index(dcmg.Link(1, 2))
    assert [axes.get_ylabel()[-3:] for axes in figure.axes] == ["[V]", "[A]", " s]"]
    for part, axes in enumerate(figure.axes):
        residual, threshold = axes.lines[:2]
        np.testing.assert_allclose(np.asarray(residual.get_xdata()), np.arange(90, 120) * 0.01)
        expected = np.abs(record.residual[90:120, at, part])
        np.testing.assert_array_equal(np.asarray(residual.get_ydata()), np.maximum(expected, 1e-16))
        assert residual.get_linestyle() != threshold.get_linestyle()
        assert axes.get_xlim() == pytest.approx((0.9, 1.2))


def test_links_that_there_is_something_to_say_about(record: RunRecord) -> None:
    """Without a choice: those that were attacked or alarmed; `all` are all, in the order of the run."""
    titles = [axes.get_title(loc="left") for axes in dcmg.plot(record, "residuals").axes]
    assert {r"link $1 \to 2$, attacked", r"link $3 \to 1$, attacked"} <= set(titles)
    every = [axes.get_title(loc="left") for axes in dcmg.plot(record, "residuals", links="all").axes]
    assert len(every) == len(record.links)


def test_what_the_graph_says_is_said_by_dashes_and_widths_too(record: RunRecord) -> None:
    """An arrow a link; attacked ones are not told by colour alone."""
    (axes,) = dcmg.plot(record, "topology").axes
    arrows = [patch for patch in axes.patches if isinstance(patch, FancyArrowPatch)]
    assert len(arrows) == len(record.links)
    looks = {(arrow.get_linewidth(), str(arrow.get_linestyle())): arrow.get_edgecolor() for arrow in arrows}
    assert len(looks) == len(set(looks.values()))


def test_a_part_of_a_run_is_drawn_as_in_the_whole(record: RunRecord) -> None:
    """Curves of steps [50, 90) are those rows of the curves of all steps, however the run is cut into windows."""
    whole = gather([record], record.steps).curves
    cut = [record.rows(0, 70), record.rows(70, 75), record.rows(75, record.steps)]
    part = gather(cut, record.steps, drawn=(50, 90)).curves
    for name in ("x", "residual", "score", "impact"):
        np.testing.assert_array_equal(getattr(part, name).high, getattr(whole, name).high[50:90])
    np.testing.assert_array_equal(part.x.times(0.01), whole.x.times(0.01)[50:90])


def test_what_cannot_be_drawn_is_refused_in_one_line(record: RunRecord) -> None:
    """A run without steps, one without truth, and a page that is too short."""
    with pytest.raises(dcmg.BagError, match="no complete step"):
        dcmg.plot(record.rows(0, 0))
    blind = replace(record, arrays={**record.arrays, "state.x": np.full_like(record.x, np.nan)})
    with pytest.raises(dcmg.BagError, match="no true states"):
        dcmg.plot(blind, "states")
    quiet = replace(record, events=())
    with pytest.raises(dcmg.BagError, match="attacked and quiet"):
        dcmg.plot(quiet, "roc")


def test_text_of_a_figure_can_be_found(record: RunRecord, tmp_path: Path) -> None:
    """Letters of the PDF are letters: streams show text, not outlines."""
    pdf = _written(dcmg.plot(record, "states"), tmp_path / "a.pdf")
    streams = re.findall(rb"stream\r?\n(.*?)\r?\nendstream", pdf, flags=re.DOTALL)
    assert any(b" Tj" in zlib.decompress(one) for one in streams if one[:1] == b"x")


def test_the_page_is_right(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every figure and style stands on it, styles with their widths, and its snippet writes the file it names."""
    page = PAGE.read_text(encoding="utf-8")
    assert all(f"| `{kind}` |" in page for kind in KINDS)
    for style in STYLES.values():
        assert f"| `{style.name}` | {style.single:.2f}, {style.double:.2f} |" in page
    (snippet,) = re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)
    monkeypatch.chdir(tmp_path)
    exec(compile(snippet, "figures.md", "exec"), {})  # noqa: S102 (our own page)
    assert (tmp_path / "components.pdf").read_bytes().startswith(b"%PDF")
