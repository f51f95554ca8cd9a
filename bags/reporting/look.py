"""Colours and frames that all figures of a report share."""

from typing import Any, Final

from bokeh.models import BoxAnnotation, HoverTool, Range1d
from bokeh.plotting import figure

# Okabe and Ito's palette, readable with any colour vision; its vermilion is kept for attacks and alarms
COLOURS: Final = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#7F7F00", "#332288", "#999999")
DASHES: Final = ("solid", "dashed", "dotted")
ALERT: Final = "#D55E00"
SHADE: Final = "#f8dfcc"
INK: Final = "#1f2933"
MUTED: Final = "#6b7785"
_GRID: Final = "#e6eaee"
_FONT: Final = "Inter, 'Segoe UI', 'Helvetica Neue', Arial, sans-serif"


def look(position: int) -> tuple[str, str]:
    """Colour and dash of a DGU or link."""
    return COLOURS[position % len(COLOURS)], DASHES[position // len(COLOURS) % len(DASHES)]


def frame(height: int, x_range: Range1d | None, **options: Any) -> figure:  # noqa: ANN401 - what bokeh's figure takes
    """An empty figure as wide as the page."""
    ranges = {} if x_range is None else {"x_range": x_range}
    plot = figure(
        height=height,
        sizing_mode="stretch_width",
        tools="box_zoom,xpan,xwheel_zoom,reset,save",
        active_drag="box_zoom",
        active_scroll=None,
        toolbar_location="right",
        output_backend="canvas",
        **ranges,
        **options,
    )
    plot.toolbar.logo = None
    plot.toolbar.autohide = True
    plot.outline_line_color = None
    plot.background_fill_color = plot.border_fill_color = "#ffffff"
    plot.grid.grid_line_color = _GRID
    plot.title.text_font = _FONT
    plot.title.text_font_size = "13px"
    plot.title.text_color = INK
    for axis in plot.axis:
        axis.axis_label_text_font = axis.major_label_text_font = _FONT
        axis.axis_label_text_font_style = "normal"
        axis.axis_label_text_font_size, axis.major_label_text_font_size = "12px", "11px"
        axis.axis_label_text_color, axis.major_label_text_color = INK, MUTED
        axis.axis_line_color = axis.major_tick_line_color = "#b8c1ca"
        axis.minor_tick_line_color = None
    return plot


def hover(plot: figure, *tooltips: tuple[str, str]) -> None:
    """Say what is under the pointer."""
    plot.add_tools(HoverTool(tooltips=list(tooltips), mode="mouse", point_policy="snap_to_data"))


def legend(plot: figure, columns: int) -> None:
    """Put the legend above the plot, in so many columns; a click hides a curve."""
    if not plot.legend:
        return
    box = plot.legend[0]
    plot.add_layout(box, "above")
    box.tags = [columns]  # as many where the page is wide
    box.orientation, box.ncols, box.click_policy = "horizontal", columns, "hide"
    box.border_line_color, box.background_fill_alpha = None, 0.0
    box.label_text_font, box.label_text_font_size, box.label_text_color = _FONT, "11px", INK
    box.padding, box.margin, box.spacing, box.glyph_width = 0, 4, 12, 18


def shade(plot: figure, intervals: list[tuple[float, float]]) -> None:
    """Mark the time of attacks."""
    for start, stop in intervals:
        plot.add_layout(
            BoxAnnotation(left=start, right=stop, fill_color=SHADE, fill_alpha=0.8, line_color=None, level="underlay")
        )
