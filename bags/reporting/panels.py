"""Panels over time that the pictures of a run and the figures for papers share."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from bags.reporting.ink import ALERT, ALERT_SHADE, BUSY, INK, MUTED, look
from bags.reporting.judged import Judged
from bags.reporting.timeline import Timeline
from monitor.detectors import Phase

LEAST: Final = 1e-3  # scores below are as good as zero, and drawn here


def draw_score(
    axes: Axes, timeline: Timeline, judged: Judged, position: int, *, size: float = 9.0, width: float = 1.0
) -> None:
    """Draw the largest |r_i| / threshold_i of a link on a logarithmic axis: its attacks, its threshold, first alarms.

    Args:
        axes: Where.
        timeline: The run.
        judged: Its rows.
        position: Of the link.
        size: Of what is written [pt].
        width: Of the curve [pt].
    """
    axes.set_yscale("log")
    row, score = judged.links[position], timeline.curves.score
    if not row.monitored:
        axes.text(0.5, 0.5, "not monitored", transform=axes.transAxes, ha="center", color=MUTED, fontsize=size)
        return
    times = score.starts(timeline.period_sec)
    shade_busy(axes, timeline, position)
    shade(axes, timeline.attack_intervals(row.link), timeline)
    axes.axhline(1.0, color=INK, linewidth=width, linestyle="--")
    axes.plot(times, np.maximum(score.high[:, position], LEAST), color=look(0)[0], linewidth=width)
    mark_alarms(axes, timeline, judged, position, size=0.75 * size)


def mark_alarms(axes: Axes, timeline: Timeline, judged: Judged, position: int, *, size: float) -> None:
    """Mark the first alarm of each attack on a link at the upper edge."""
    for episode in judged.links[position].episodes:
        if episode.alarm_step is not None:
            at = episode.alarm_step * timeline.period_sec
            axes.plot([at], [0.93], color=ALERT, marker="v", markersize=size, transform=axes.get_xaxis_transform())


def score_handles() -> list[Line2D | Patch]:
    """What the marks of `draw_score` mean."""
    return [
        Line2D([], [], color=look(0)[0], linewidth=1.4, label="residual / threshold"),
        Line2D([], [], color=INK, linewidth=1.0, linestyle="--", label="threshold: alarm above"),
        Patch(color=BUSY, label="settles or calibrates"),
        Patch(color=ALERT_SHADE, label="attack on this link"),
        Line2D([], [], color=ALERT, marker="v", linestyle="", label="first alarm of an attack"),
    ]


def shade_busy(axes: Axes, timeline: Timeline, position: int) -> None:
    """Shade the time at which the detector of a link settles or calibrates."""
    score = timeline.curves.score
    steps = score.first_step + np.arange(len(score.low)) * score.length
    busy = timeline.phase[np.minimum(steps, timeline.steps - 1), position] != Phase.ARMED.value
    times = score.starts(timeline.period_sec)
    axes.fill_between(
        times, 0.0, 1.0, where=busy.tolist(), step="post", transform=axes.get_xaxis_transform(), color=BUSY, linewidth=0
    )


def shade(axes: Axes, intervals: Sequence[tuple[int, int]], timeline: Timeline) -> None:
    """Shade the time of attacks, given as steps [start, stop)."""
    for start, stop in sorted(set(intervals)):
        axes.axvspan(start * timeline.period_sec, stop * timeline.period_sec, color=ALERT_SHADE, linewidth=0, zorder=0)
