"""Picture of a team: the errors of its members, and who accuses whom."""

from collections.abc import Callable, Sequence
from typing import Final, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bags.reporting.outline import Outline
from bags.reporting.team_outline import TeamOutline

Look: TypeAlias = Callable[[int], tuple[str, tuple[float, tuple[float, ...]]]]

_COMPONENTS: Final = ("any $V$ [V]", "any $I_t$ [A]", "any $v$ [V s]")
_ALERT: Final = "#D55E00"
_FLOOR: Final = 1e-14


def draw_team(outline: Outline, team: TeamOutline, prepare: Callable[[Axes], None], look: Look) -> Figure:
    """Largest error of each member over time for V, I_t and v, and below it a row of accusations for each pair.

    Args:
        outline: The run.
        team: Its team.
        prepare: Gives axes their looks.
        look: Colour and line style of a DGU by its position.
    """
    figure = Figure(figsize=(9.0, 9.5), layout="constrained")
    *panels, lower = figure.subplots(4, 1, sharex=True, height_ratios=(3, 3, 3, 2))
    for kind, axes in enumerate(panels):
        prepare(axes)
        axes.set_ylabel(f"largest error of {_COMPONENTS[kind]}", fontsize=9)
        for at, _ in enumerate(team.members):
            colour, style = look(at)
            error = np.maximum(team.error[:, at, kind], _FLOOR)
            axes.semilogy(outline.stretch_sec, error, color=colour, linestyle=style, linewidth=1.2)
    prepare(lower)
    _draw_accusations(lower, outline, team)
    handles = [
        Line2D([], [], color=look(at)[0], linestyle=look(at)[1], linewidth=1.6, label=f"member {one.member}")
        for at, one in enumerate(team.members)
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=min(len(handles), 8), frameon=False, fontsize=9)
    lower.set_xlabel("simulated time [s]")
    lower.set_xlim(0.0, outline.duration_sec)
    return figure


def _draw_accusations(axes: Axes, outline: Outline, team: TeamOutline) -> None:
    pairs = sorted({(one.monitor, one.source) for one in team.alarms})
    axes.set_yticks(range(len(pairs)), [f"{one} accuses {two}" for one, two in pairs], fontsize=8)
    axes.set_ylim(len(pairs) - 0.5 if pairs else 0.5, -0.5)
    for row, pair in enumerate(pairs):
        for start, end in _spans(pair, outline, team):
            axes.plot([start, end], [row, row], color=_ALERT, linewidth=4.0, solid_capstyle="butt")
    if not pairs:
        axes.set_yticks([])
        axes.text(
            0.5, 0.5, "nobody is accused" if team.accepted else team.verdict, transform=axes.transAxes, ha="center"
        )


def _spans(pair: tuple[int, int], outline: Outline, team: TeamOutline) -> Sequence[tuple[float, float]]:
    """Begin and end of the accusations of one member by another [s]."""
    times = [one.step * outline.run.sampling_period_sec for one in team.alarms if (one.monitor, one.source) == pair]
    if len(times) % 2:
        times.append(outline.duration_sec)
    return list(zip(times[::2], times[1::2], strict=True))
