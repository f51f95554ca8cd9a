"""Pictures of a run as PNG files: states of the DGUs, residuals over thresholds, and a team's errors."""

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

from bags.reporting.ink import ALERT, ALERT_SHADE, INK, look, prepare
from bags.reporting.judged import AttackRow, Judged
from bags.reporting.panels import LEAST, draw_score, score_handles, shade
from bags.reporting.team_picture import draw_team
from bags.reporting.timeline import Timeline

_PANELS_PER_ROW: Final = 4
_STATES = ("bus voltage $V$ [V]", "filter current $I_t$ [A]")
_MOST_LABELS: Final = 6  # names of attacks that fit above the states
_DPI: Final = 150


def draw(timeline: Timeline, judged: Judged, folder: Path | str) -> tuple[Path, ...]:
    """Draw a run into PNG files.

    Args:
        timeline: The run.
        judged: Its rows.
        folder: Where to; made if it does not exist.

    Returns:
        The files: states.png, residuals.png and, of a team of monitors, team.png; none for a run without a complete
        step.
    """
    folder = Path(folder)
    if not timeline.steps:
        return ()
    folder.mkdir(parents=True, exist_ok=True)
    figures = {"states.png": draw_states(timeline, judged)}
    if timeline.run.links:
        figures["residuals.png"] = draw_residuals(timeline, judged)
    if timeline.team is not None:
        figures["team.png"] = draw_team(timeline, timeline.team)
    for name, figure in figures.items():
        FigureCanvasAgg(figure)
        figure.savefig(folder / name, dpi=_DPI)
    return tuple(folder / name for name in figures)


def draw_states(timeline: Timeline, judged: Judged) -> Figure:
    """Voltage, current and secondary correction of every DGU over time; attacks are shaded and named."""
    figure = Figure(figsize=(9.0, 8.0), layout="constrained")
    curves, dgus = timeline.curves, timeline.run.topics.dgus
    count, times = range(len(dgus)), curves.x.times(timeline.period_sec)
    labels = _STATES[: curves.x.low.shape[2]]  # a plant from outside may have one state
    quantities = [(times, [curves.x.line(at, state) for at in count], label) for state, label in enumerate(labels)]
    corrections = [curves.alpha.line(at) for at in count]
    quantities.append((curves.alpha.times(timeline.period_sec), corrections, r"secondary correction $\alpha$ [V]"))
    panels = figure.subplots(len(quantities), 1, sharex=True)
    rows = [row for row in judged.attacks if row.attack.began]
    for axes, (times, lines, label) in zip(panels, quantities, strict=True):
        prepare(axes)
        axes.set_ylabel(label, color=INK)
        for position, line in enumerate(lines):
            colour, style = look(position)
            axes.plot(times, line, color=colour, linestyle=style, linewidth=1.3)
        shade(axes, [(row.attack.start_step, row.attack.stop_step) for row in rows], timeline)
    mean = curves.x.low[:, :, 0].mean(axis=1) / 2 + curves.x.high[:, :, 0].mean(axis=1) / 2
    panels[0].plot(curves.x.starts(timeline.period_sec), mean, color=INK, linewidth=2.4, alpha=0.5)
    _name_attacks(panels[0], rows)
    handles: list[Line2D | Patch] = []
    for position, dgu in enumerate(dgus):
        colour, style = look(position)
        handles.append(Line2D([], [], color=colour, linestyle=style, linewidth=1.6, label=f"DGU {dgu}"))
    handles.append(Line2D([], [], color=INK, linewidth=2.4, alpha=0.5, label="mean of all"))
    if rows:
        handles.append(Patch(color=ALERT_SHADE, label="attack"))
    figure.legend(
        handles=handles,
        loc="outside upper center",
        ncols=min(len(handles), 5),
        frameon=False,
        fontsize=9,
        handlelength=4,
    )
    panels[-1].set_xlabel("simulated time [s]", color=INK)
    panels[-1].set_xlim(0.0, _end(timeline))
    return figure


def _name_attacks(axes: Axes, rows: Sequence[AttackRow]) -> None:
    """Say which attack each shaded time is, one line an attack, where there is room."""
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.09 * min(len(rows), _MOST_LABELS) * (high - low))
    for number, row in enumerate(rows[:_MOST_LABELS]):
        links = ", ".join(str(link) for link in row.attack.links[:3]) + (" …" if len(row.attack.links) > 3 else "")  # noqa: PLR2004 - as many as fit
        axes.text(
            row.episode.start_sec,
            0.99 - 0.06 * number,
            f" {row.attack.kind} on {links}{'' if row.episode.detected else ' (missed)'}",
            transform=axes.get_xaxis_transform(),
            va="top",
            fontsize=7.5,
            color=ALERT,
            clip_on=True,
        )


def draw_residuals(timeline: Timeline, judged: Judged) -> Figure:
    """Largest |r_i| / threshold_i of every link, one panel and one curve each; an alarm is a curve above 1."""
    shown = timeline.telling()
    columns = min(_PANELS_PER_ROW, len(shown))
    rows = -(-len(shown) // columns)
    figure = Figure(figsize=(3.1 * columns + 0.6, 2.0 * rows + 1.1), layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    high = timeline.curves.score.high[:, shown]
    largest = float(np.nanmax(high, initial=3.0, where=np.isfinite(high)))
    for number, position in enumerate(shown):
        axes = grid[number // columns, number % columns]
        prepare(axes)
        _title(axes, timeline, judged, position)
        draw_score(axes, timeline, judged, position)
        axes.set_ylim(LEAST / 1.5, largest * 4.0)
        axes.set_xlim(0.0, _end(timeline))
        axes.xaxis.set_major_locator(MaxNLocator(5))
    _legend(figure, grid, len(shown))
    figure.supxlabel("simulated time [s]", fontsize=10, color=INK)
    figure.supylabel(r"largest $|r_i|$ / threshold$_i$ [1]", fontsize=10, color=INK)
    return figure


def _legend(figure: Figure, grid: np.ndarray, used: int) -> None:
    """Explain the marks: in the first free slot, or above the panels where there is none."""
    handles = score_handles()
    free = grid.flat[used:]
    if not len(free):
        figure.legend(handles=handles, loc="outside upper center", ncols=3, frameon=False, fontsize=9)
        return
    for axes in free:
        axes.set_axis_off()
    free[0].legend(handles=handles, loc="center left", frameon=False, fontsize=9)
    for position in range(used, grid.size):
        if position >= grid.shape[1]:
            grid.flat[position - grid.shape[1]].tick_params(labelbottom=True)


def _title(axes: Axes, timeline: Timeline, judged: Judged, position: int) -> None:
    link = judged.links[position].link
    title = f"{link.source} → {link.target}"
    if not timeline.attack_intervals(link):
        axes.set_title(title, fontsize=9, color=INK)
        return
    axes.set_title(f"{title}   attacked", fontsize=9, fontweight="bold", color=ALERT)
    for spine in axes.spines.values():
        spine.set(color=ALERT, linewidth=1.4, visible=True)


def _end(timeline: Timeline) -> float:
    return max(timeline.duration_sec, timeline.period_sec)
