"""Picture of a team: the errors of its members, and who accuses whom."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bags.reporting.ink import ALERT, look, prepare
from bags.reporting.team import TeamSummary
from bags.reporting.timeline import Timeline
from monitor.measures import spans

_COMPONENTS: Final = ("any $V$ [V]", "any $I_t$ [A]", "any $v$ [V s]")
_FLOOR: Final = 1e-14


def draw_team(timeline: Timeline, team: TeamSummary) -> Figure:
    """Largest error of each member over time for V, I_t and v, and below it a row of accusations for each pair."""
    figure = Figure(figsize=(9.0, 9.5), layout="constrained")
    *panels, lower = figure.subplots(4, 1, sharex=True, height_ratios=(3, 3, 3, 2))
    times = team.error.starts(timeline.period_sec)
    for kind, axes in enumerate(panels):
        prepare(axes)
        axes.set_ylabel(f"largest error of {_COMPONENTS[kind]}", fontsize=9)
        for at, _ in enumerate(team.members):
            colour, style = look(at)
            error = np.maximum(team.error.high[:, at, kind], _FLOOR)
            axes.semilogy(times, error, color=colour, linestyle=style, linewidth=1.2)
    prepare(lower)
    _draw_accusations(lower, timeline, team)
    handles = [
        Line2D([], [], color=look(at)[0], linestyle=look(at)[1], linewidth=1.6, label=f"member {one.member}")
        for at, one in enumerate(team.members)
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=min(len(handles), 8), frameon=False, fontsize=9)
    lower.set_xlabel("simulated time [s]")
    lower.set_xlim(0.0, timeline.duration_sec)
    return figure


def _draw_accusations(axes: Axes, timeline: Timeline, team: TeamSummary) -> None:
    lasted = spans(((one.step, (one.monitor, one.source), one.active) for one in team.alarms), timeline.steps)
    pairs = sorted(lasted)
    axes.set_yticks(range(len(pairs)), [f"{one} accuses {two}" for one, two in pairs], fontsize=8)
    axes.set_ylim(len(pairs) - 0.5 if pairs else 0.5, -0.5)
    for row, pair in enumerate(pairs):
        for start, stop in lasted[pair]:
            times = [start * timeline.period_sec, stop * timeline.period_sec]
            axes.plot(times, [row, row], color=ALERT, linewidth=4.0, solid_capstyle="butt")
    if not pairs:
        axes.text(
            0.5, 0.5, "nobody is accused" if team.accepted else team.verdict, transform=axes.transAxes, ha="center"
        )
