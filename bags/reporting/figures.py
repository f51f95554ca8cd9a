"""The interactive figures of a report."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from bokeh.layouts import column, gridplot
from bokeh.models import ColorBar, ColumnDataSource, FixedTicker, LinearColorMapper, Range1d, Span
from bokeh.models.ui import UIElement
from bokeh.plotting import figure
from numpy.typing import NDArray

from bags.reporting.assessment import IMPACTS, Assessment
from bags.reporting.curves import FLOOR, log_range
from bags.reporting.fold import Envelope
from bags.reporting.look import ALERT, COLOURS, INK, MUTED, frame, hover, legend, look, shade
from bags.reporting.timeline import MOST_PANELS, Timeline

COMPONENTS: Final = ("V [V]", "I_t [A]", "v [V s]")
_MOST_INPUTS: Final = 6
_DECADES: Final = (-3.0, 2.0)  # of the score in the overview


def figures(timeline: Timeline, assessment: Assessment) -> Mapping[str, UIElement]:
    """All figures by name; zooming one in time zooms all."""
    end = max(timeline.steps, 1) * timeline.period_sec
    time = Range1d(start=0.0, end=end, bounds=(0.0, end))
    found: dict[str, UIElement] = {}
    if not timeline.steps:
        return found
    if timeline.run.links:
        found["overview"] = _overview(timeline, time)
        found |= {f"residuals-{number}": plot for number, plot in enumerate(_residuals(timeline, assessment, time))}
        if np.isfinite(timeline.curves.inputs.high).any():
            found["inputs"] = _inputs(timeline, time)
    if timeline.truth:
        found["states"] = _states(timeline, time)
        found["impact"] = _impact(timeline, assessment, time)
    if assessment.hardest is not None:
        found["roc"] = _roc(assessment)
    return found


def _windows(timeline: Timeline, position: int | None = None) -> list[tuple[float, float]]:
    """Times of the attacks on one link, or on any."""
    links = timeline.run.links if position is None else timeline.run.links[position : position + 1]
    found = {one for link in links for one in timeline.attack_intervals(link)}
    return [(start * timeline.period_sec, stop * timeline.period_sec) for start, stop in sorted(found)]


def _overview(timeline: Timeline, time: Range1d) -> figure:
    """Links by time, coloured by how close each residual is to its threshold."""
    names = [_arrow(timeline, position) for position in range(len(timeline.run.links))]
    score, own = timeline.curves.score.high, timeline.curves.own.high
    if np.isfinite(own).any():
        names += [f"own state {monitor}" for monitor in timeline.run.topics.monitors]
        score = np.concatenate([score, own], axis=1)
    height = 90 + 22 * len(names) if len(names) <= MOST_PANELS else 620
    plot = frame(height, time, y_range=Range1d(start=len(names), end=0))
    shown = np.clip(np.log10(np.maximum(score, 1e-30)), *_DECADES).astype(np.float32)
    mapper = LinearColorMapper(palette=_diverging(), low=_DECADES[0], high=-_DECADES[0], nan_color="#f1f3f5")
    end = len(score) * timeline.curves.score.length * timeline.period_sec
    # a y range upside down: the first row of the image lies at the top
    plot.image(image=[shown.T], x=0.0, y=0.0, dw=end, dh=len(names), color_mapper=mapper)
    for position in range(len(timeline.run.links)):
        for start, stop in _windows(timeline, position):
            plot.quad(left=start, right=stop, top=position, bottom=position + 1, fill_alpha=0.0, line_color=INK)
    plot.yaxis.ticker = FixedTicker(ticks=[position + 0.5 for position in range(len(names))])
    plot.yaxis.major_label_overrides = {position + 0.5: name for position, name in enumerate(names)}
    plot.xaxis.axis_label = "simulated time [s]"
    plot.ygrid.visible = False
    bar = ColorBar(
        color_mapper=mapper,
        ticker=FixedTicker(ticks=[-3, -2, -1, 0, 1, 2, 3]),
        major_label_overrides={-3: "≤ 0.001", -2: "0.01", -1: "0.1", 0: "threshold", 1: "10", 2: "≥ 100", 3: ""},
        width=10,
        padding=6,
        major_label_text_color=MUTED,
        bar_line_color=None,
    )
    plot.add_layout(bar, "right")
    return plot


def _states(timeline: Timeline, time: Range1d) -> UIElement:
    """Voltage, current and secondary correction of every DGU."""
    curves, dgus = timeline.curves, timeline.run.topics.dgus
    rows = (
        ("bus voltage V [V]", [curves.x.line(position, 0) for position in range(len(dgus))], curves.x),
        ("filter current I_t [A]", [curves.x.line(position, 1) for position in range(len(dgus))], curves.x),
        ("secondary correction [V]", [curves.alpha.line(position) for position in range(len(dgus))], curves.alpha),
    )
    plots = []
    for number, (label, lines, envelope) in enumerate(rows):
        plot = frame(250 if number == 0 else 190, time, y_axis_label=label)
        shade(plot, _windows(timeline))
        for position, (dgu, line) in enumerate(zip(dgus, lines, strict=True)):
            colour, dash = look(position)
            name = {"legend_label": f"DGU {dgu}"} if number == 0 and len(dgus) <= MOST_PANELS else {}
            _line(plot, envelope.times(timeline.period_sec), line, f"DGU {dgu}", color=colour, line_dash=dash, **name)
        if number == 0:
            legend(plot, 8)
        hover(plot, ("", "$name"), ("t", "@x{0.00} s"), ("", "@y{0.0000}"))
        plots.append(plot)
    plots[-1].xaxis.axis_label = "simulated time [s]"
    return column(*plots, sizing_mode="stretch_width")


def _impact(timeline: Timeline, assessment: Assessment, time: Range1d) -> UIElement:
    """How far the grid is from its goals, and would have been without a response."""
    envelope, without = timeline.curves.impact, Envelope.empty(timeline.steps, timeline.curves.impact.length, 3)
    if assessment.unanswered is not None:
        without.add(np.column_stack([getattr(assessment.unanswered, name) for name in IMPACTS]), 0)
    labels = (("⟨V⟩ - ⟨V_ref⟩ [V]", 0), ("max |V_i - V_ref,i| [V]", 1), ("spread of I/Iʳ", 2))
    plots = []
    for label, position in labels:
        plot = frame(150, time, y_axis_label=label)
        shade(plot, _windows(timeline))
        times = envelope.times(timeline.period_sec)
        if assessment.unanswered is not None:
            _line(plot, times, without.line(position), "without response", color=ALERT, line_dash="dashed")
        _line(plot, times, envelope.line(position), label, color=COLOURS[position])
        hover(plot, ("", "$name"), ("t", "@x{0.00} s"), ("", "@y{0.0000}"))
        plots.append(plot)
    plots[-1].xaxis.axis_label = "simulated time [s]"
    return column(*plots, sizing_mode="stretch_width")


def _inputs(timeline: Timeline, time: Range1d) -> UIElement:
    """Reconstructed inputs between their limits, of the links that there is something to say about."""
    envelope, alarm = timeline.curves.inputs, timeline.alarms.get("plausibility")
    times = envelope.times(timeline.period_sec)
    told = [
        position
        for position, link in enumerate(timeline.run.links)
        if timeline.attack_intervals(link) or (alarm is not None and alarm[:, position].any())
    ] or [0]
    plots = []
    for position in told[:_MOST_INPUTS]:
        for part, label in enumerate(("load and line current [A]", "reference [V]")):
            plot = frame(190, time, title=f"{_arrow(timeline, position)}   {label}")
            shade(plot, _windows(timeline, position))
            _line(plot, times, envelope.line(position, 0, part), "reconstructed", color=COLOURS[part])
            for limit in (1, 2):
                _line(plot, times, envelope.line(position, limit, part), "limit", color=MUTED, line_dash="dashed")
            hover(plot, ("", "$name"), ("t", "@x{0.00} s"), ("", "@y{0.0000}"))
            plots.append(plot)
    return gridplot(plots, ncols=2, sizing_mode="stretch_width", toolbar_location=None, merge_tools=False)


def _residuals(timeline: Timeline, assessment: Assessment, time: Range1d) -> list[figure]:
    """Residuals against thresholds, one panel a link."""
    shown = timeline.telling()
    residual, threshold = timeline.curves.residual, timeline.curves.threshold
    limits = log_range(residual.high[:, shown], threshold.high[:, shown])
    value = Range1d(start=limits[0], end=limits[1])
    times = residual.starts(timeline.period_sec)
    outputs = residual.high.shape[-1]
    labels = COMPONENTS if outputs == len(COMPONENTS) else [f"output {part + 1}" for part in range(outputs)]
    plots = []
    for position in shown:
        windows = _windows(timeline, position)
        name = _arrow(timeline, position)
        plot = frame(190, time, y_range=value, y_axis_type="log", title=f"{name}   attacked" if windows else name)
        if windows:
            plot.title.text_color = ALERT
        shade(plot, windows)
        design = timeline.run.designs.get(timeline.run.links[position])
        if design is not None and not design.accepted:
            plot.title.text, plot.title.text_color = f"{name}   not monitored", MUTED
        for part, label in enumerate(labels):
            line = np.maximum(residual.high[:, position, part], FLOOR)
            _line(plot, times, line, label, color=COLOURS[part % len(COLOURS)])
        for colour, line in _thresholds(threshold.high[:, position]):
            _line(plot, times, line, "threshold", color=colour, line_dash="dashed")
        for episode in assessment.judged.links[position].episodes:
            if episode.delay_sec is not None:
                at = episode.start_sec + episode.delay_sec
                plot.scatter([at], [limits[1] / 2.0], marker="inverted_triangle", size=9, color=ALERT, name="alarm")
        hover(plot, ("", "$name"), ("t", "@x{0.00} s"), ("", "@y{0.00e}"))
        plots.append(plot)
    return plots


def _thresholds(limits: NDArray[np.float64]) -> list[tuple[str, NDArray[np.float64]]]:
    """Colours and curves of the thresholds: one grey curve when all components have the same."""
    if np.array_equal(limits, np.repeat(limits[:, :1], limits.shape[1], axis=1), equal_nan=True):
        return [(MUTED, limits[:, 0])]
    return [(COLOURS[part], limits[:, part]) for part in range(limits.shape[1])]


def _roc(assessment: Assessment) -> figure:
    """One curve a link that was attacked; links are not pooled, because their scores are not to be compared."""
    plot = frame(360, None, x_axis_label="false-alarm rate per sample", y_axis_label="attacked samples seen")
    plot.line([0, 1], [0, 1], color=MUTED, line_dash="dotted")
    curves = [(f"{one.row.link.source} → {one.row.link.target}", one.roc) for one in assessment.links if one.roc]
    for position, (name, curve) in enumerate(curves[:MOST_PANELS]):
        colour, dash = look(position)
        x, y = curve.false_positive_rate, curve.true_positive_rate
        label = f"{name}: AUC {curve.area.value:.4f}"
        _line(plot, x, y, label, color=colour, line_dash=dash, line_width=2, legend_label=label)
    legend(plot, 3)
    plot.x_range, plot.y_range = Range1d(start=-0.01, end=1.01), Range1d(start=-0.01, end=1.01)
    plot.add_layout(Span(location=0, dimension="height", line_color=MUTED, line_alpha=0.3))
    hover(plot, ("", "$name"), ("false alarms", "@x{0.0000}"), ("seen", "@y{0.0000}"))
    return plot


def _line(plot: figure, x: NDArray[Any], y: NDArray[Any], name: str, **look_of: Any) -> None:  # noqa: ANN401 - bokeh's
    """A curve in single precision, half the bytes; its legend, colour and dash are bokeh's."""
    source = ColumnDataSource({"x": x.astype(np.float32), "y": y.astype(np.float32)})
    plot.line("x", "y", source=source, name=name, **{"line_width": 1.4, **look_of})


def _arrow(timeline: Timeline, position: int) -> str:
    link = timeline.run.links[position]
    return f"{link.source} → {link.target}"


def _diverging() -> list[str]:
    """Blue to white below the threshold, white to vermilion above."""
    ends = (np.array([0x0B, 0x4F, 0x8A]), np.array([0xFF, 0xFF, 0xFF]), np.array([0xD5, 0x3E, 0x00]))
    shares = np.linspace(0.0, 1.0, 64)
    colours = [ends[0] + share * (ends[1] - ends[0]) for share in shares]
    colours += [ends[1] + share**0.5 * (ends[2] - ends[1]) for share in shares[1:]]
    return ["#" + "".join(f"{round(part):02x}" for part in colour) for colour in colours]
