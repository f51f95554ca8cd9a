"""Pictures of a recorded run: the states of the DGUs and the residuals of the monitors."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from bags.reporting.outline import Outline, outline_of
from bags.reporting.team_plot import draw_team
from bags.runs.run_record import RunRecord

# Okabe and Ito's palette, readable with any colour vision; its vermilion is kept for attacks and alarms
_COLOURS: Final = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#7F7F00", "#332288", "#999999")
_ALERT: Final = "#D55E00"
_INK: Final = "#222222"
_MUTED: Final = "#777777"
# offset and lengths of dashes and gaps: solid, dashed, dotted
_STYLES: Final[tuple[tuple[float, tuple[float, ...]], ...]] = ((0, ()), (0, (5, 2)), (0, (1, 1)))
_COMPONENTS: Final = ("$V$ [V]", "$I_t$ [A]", "$v$ [V s]")
_PANELS_PER_ROW: Final = 4
_DPI: Final = 150
_FLOOR: Final = 1e-16  # rounding of double precision: smaller residuals are drawn here


def draw(run: RunRecord | Outline, folder: Path) -> tuple[Path, ...]:
    """Draw a run into PNG files.

    Args:
        run: The run, or its outline.
        folder: Where to; made if it does not exist.

    Returns:
        The files: states.png, residuals.png and, of a team of monitors, team.png; none for a run without a complete
        step.
    """
    outline = run if isinstance(run, Outline) else outline_of(run)
    if not outline.steps:
        return ()
    folder.mkdir(parents=True, exist_ok=True)
    figures = {"states.png": draw_states(outline)}
    if outline.run.links:
        figures["residuals.png"] = draw_residuals(outline)
    if outline.team is not None:
        figures["team.png"] = draw_team(outline, outline.team, _prepare, _look)
    for name, figure in figures.items():
        FigureCanvasAgg(figure)
        figure.savefig(folder / name, dpi=_DPI)
    return tuple(folder / name for name in figures)


def draw_states(outline: Outline) -> Figure:
    """Voltage, current and secondary correction of every DGU over time."""
    figure = Figure(figsize=(9.0, 8.0), layout="constrained")
    upper, middle, lower = figure.subplots(3, 1, sharex=True)
    quantities = (
        (upper, outline.x[:, :, 0], "bus voltage $V$ [V]"),
        (middle, outline.x[:, :, 1], "filter current $I_t$ [A]"),
        (lower, outline.alpha, r"secondary correction $\alpha$ [V]"),
    )
    for axes, values, label in quantities:
        _prepare(axes)
        axes.set_ylabel(label, color=_INK)
        for position, _ in enumerate(outline.run.topics.dgus):
            colour, style = _look(position)
            axes.plot(outline.time_sec, values[:, position], color=colour, linestyle=style, linewidth=1.3)
        _shade(axes, [one for link in outline.run.links for one in outline.attack_intervals(link)], outline)
    mean = outline.x[:, :, 0].mean(axis=1)
    upper.plot(outline.time_sec, mean, color=_INK, linewidth=1.6, linestyle=(0, (5, 2)))
    handles: list[Line2D | Patch] = []
    for position, dgu in enumerate(outline.run.topics.dgus):
        colour, style = _look(position)
        handles.append(Line2D([], [], color=colour, linestyle=style, linewidth=1.6, label=f"DGU {dgu}"))
    handles.append(Line2D([], [], color=_INK, linestyle=(0, (5, 2)), linewidth=1.6, label="mean of all"))
    if outline.run.events:
        handles.append(Patch(color=_ALERT, alpha=0.15, label="attack"))
    figure.legend(handles=handles, loc="outside upper center", ncols=min(len(handles), 8), frameon=False, fontsize=9)
    lower.set_xlabel("simulated time [s]", color=_INK)
    lower.set_xlim(0.0, _end(outline))
    return figure


def draw_residuals(outline: Outline) -> Figure:
    """Residuals and thresholds of every monitored link, one panel each."""
    count = len(outline.run.links)
    columns = min(_PANELS_PER_ROW, count)
    rows = -(-count // columns)
    figure = Figure(figsize=(3.1 * columns + 0.6, 2.0 * rows + 1.1), layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    low, high = _residual_range(outline)
    for position in range(count):
        axes = grid[position // columns, position % columns]
        _prepare(axes)
        _residual_panel(axes, outline, position)
        axes.set_yscale("log")
        axes.set_ylim(low, high)
        axes.set_xlim(0.0, _end(outline))
        axes.xaxis.set_major_locator(MaxNLocator(5))
    for position in range(count, rows * columns):
        grid[position // columns, position % columns].remove()
        grid[position // columns - 1, position % columns].tick_params(labelbottom=True)
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=_COLOURS[component], linewidth=1.6, label=f"residual of {name}")
        for component, name in enumerate(_COMPONENTS)
    ]
    handles.append(Line2D([], [], color=_MUTED, linewidth=1.2, linestyle="--", label="threshold"))
    handles.append(Patch(color=_ALERT, alpha=0.15, label="attack"))
    handles.append(Line2D([], [], color=_ALERT, marker="v", linestyle="", label="first alarm"))
    figure.legend(handles=handles, loc="outside upper center", ncols=min(len(handles), 6), frameon=False, fontsize=9)
    figure.supxlabel("simulated time [s]", fontsize=10, color=_INK)
    figure.supylabel("|r|", fontsize=10, color=_INK)
    return figure


def _residual_panel(axes: Axes, outline: Outline, position: int) -> None:
    link = outline.run.links[position]
    intervals = outline.attack_intervals(link)
    title = f"{link.source} → {link.target}"
    axes.set_title(
        f"{title}   attacked" if intervals else title,
        fontsize=9,
        fontweight="bold" if intervals else "normal",
        color=_ALERT if intervals else _INK,
    )
    if intervals:
        for spine in axes.spines.values():
            spine.set(color=_ALERT, linewidth=1.4, visible=True)
    design = outline.run.designs.get(link)
    if design is None or not design.accepted:
        axes.text(0.5, 0.5, "not monitored", transform=axes.transAxes, ha="center", color=_MUTED, fontsize=9)
        return
    _shade(axes, intervals, outline)
    for component, peaks in enumerate(outline.peaks[:, position].T):
        axes.plot(outline.stretch_sec, np.maximum(peaks, _FLOOR), color=_COLOURS[component], linewidth=1.0)
    _draw_thresholds(axes, outline, position)
    alarm_sec = outline.metrics[position].alarm_sec
    if alarm_sec is not None:
        axes.plot([alarm_sec], [0.93], color=_ALERT, marker="v", markersize=7, transform=axes.get_xaxis_transform())


def _draw_thresholds(axes: Axes, outline: Outline, position: int) -> None:
    limits = outline.threshold[:, position]
    same = np.array_equal(limits, np.repeat(limits[:, :1], limits.shape[1], axis=1), equal_nan=True)
    for component in range(1 if same else limits.shape[1]):
        colour = _MUTED if same else _COLOURS[component]
        axes.plot(outline.time_sec, limits[:, component], color=colour, linewidth=1.2, linestyle="--")


def _prepare(axes: Axes) -> None:
    axes.grid(visible=True, color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(colors=_MUTED, labelsize=8)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(_MUTED)


def _shade(axes: Axes, intervals: Sequence[tuple[int, int]], outline: Outline) -> None:
    for start, stop in sorted(set(intervals)):
        period_sec = outline.run.sampling_period_sec
        axes.axvspan(start * period_sec, stop * period_sec, color=_ALERT, alpha=0.12, linewidth=0)


def _look(position: int) -> tuple[str, tuple[float, tuple[float, ...]]]:
    """Colour and line style of a DGU."""
    return _COLOURS[position % len(_COLOURS)], _STYLES[position // len(_COLOURS) % len(_STYLES)]


def _residual_range(outline: Outline) -> tuple[float, float]:
    numbers = np.concatenate([outline.peaks.ravel(), outline.threshold.ravel()])
    numbers = numbers[np.isfinite(numbers)]
    top = float(numbers.max(initial=1e-3))
    positive = numbers[numbers > _FLOOR]
    bottom = float(np.quantile(positive, 0.02)) if positive.size else _FLOOR
    return max(bottom / 3.0, _FLOOR / 3.0), top * 8.0


def _end(outline: Outline) -> float:
    return max(outline.duration_sec, outline.run.sampling_period_sec)
