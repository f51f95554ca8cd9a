"""Figures over time: residuals, states, and how far the grid is from its goals."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import NullLocator
from numpy.typing import NDArray

from bags.mcap.errors import BagError
from bags.reporting.assessment import IMPACTS
from bags.reporting.curves import FLOOR, log_range
from bags.reporting.fold import Envelope
from bags.reporting.ink import ALERT, ALERT_SHADE, BUSY, INK, look
from bags.reporting.judged import Judged
from bags.reporting.panels import LEAST, draw_score, mark_alarms, score_handles, shade, shade_busy
from bags.reporting.publication.choice import Choice
from bags.reporting.publication.sheet import (
    TIME,
    attacked,
    dress,
    handle,
    legend,
    legend_rows,
    lines,
    over_time,
    sheet,
)
from bags.reporting.publication.styles import Column
from bags.reporting.timeline import Timeline
from bags.reporting.unanswered import unanswered
from dgu_sim.grid import Link

_PANEL, _ROOM = 0.62, 1.5  # height of a residual's panel beside its title, and of all panels at least [in]
_HIGH = 0.95  # height of a panel of states or impact [in]
_MOST_NAMES = 16  # DGUs in a legend
_OUTPUTS = (("V", "V"), ("I_t", "A"), ("v", "V s"))  # symbols and units of what a DGU sends
_IMPACTS = (
    r"$\langle V\rangle - \langle V_{\mathrm{ref}}\rangle$ [V]",
    r"$\max_i |V_i - V_{\mathrm{ref},i}|$ [V]",
    r"spread of $I/I^{\mathrm{r}}$ [1]",
)


def draw_residuals(choice: Choice, timeline: Timeline, judged: Judged) -> Figure:
    """Largest |r_i| / threshold_i of each link, one panel each."""
    positions = choice.positions(timeline)
    columns = min(1 if choice.column is Column.SINGLE else 2, len(positions))
    rows = -(-len(positions) // columns)
    handles, across = score_handles(), 2 if choice.column is Column.SINGLE else 5
    height = max(rows * (_PANEL + lines(choice, 1.2)), _ROOM) + lines(choice, 2.6 + legend_rows(handles, across))
    figure = sheet(choice, height)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    high = timeline.curves.score.high[:, positions]
    largest = float(np.nanmax(high, initial=3.0, where=np.isfinite(high)))
    dress(choice, *grid.flat)
    for number, position in enumerate(positions):
        axes = grid[number // columns, number % columns]
        _name(axes, timeline, timeline.run.links[position])
        draw_score(axes, timeline, judged, position, size=choice.style.size - 1.0, width=choice.style.line)
        axes.set_ylim(LEAST / 1.5, largest * 6.0)
        axes.yaxis.set_minor_locator(NullLocator())
        over_time(choice, axes, *_span(timeline))
    for axes in grid.flat[len(positions) :]:
        axes.set_axis_off()
    legend(choice, figure, handles, across)
    figure.supxlabel(TIME, fontsize=choice.style.size, color=INK)
    figure.supylabel(r"largest $|r_i|/\theta_i$ [1]", fontsize=choice.style.size, color=INK)
    return figure


def draw_components(choice: Choice, timeline: Timeline, judged: Judged) -> Figure:
    """|r| and threshold of each output of one link, with units."""
    position = _single(choice, timeline)
    residual, threshold = (one.high[:, position] for one in (timeline.curves.residual, timeline.curves.threshold))
    count, times = residual.shape[1], timeline.curves.residual.starts(timeline.period_sec)
    names = (
        _OUTPUTS if count == len(_OUTPUTS) else tuple((f"y_{part + 1}", "unit of its output") for part in range(count))
    )
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=look(0)[0], linewidth=1.2, label="residual"),
        Line2D([], [], color=INK, linestyle="--", label="threshold"),
        Patch(color=BUSY, label="settles or calibrates"),
        Patch(color=ALERT_SHADE, label="attack"),
        Line2D([], [], color=ALERT, marker="v", linestyle="", label="first alarm"),
    ]
    across = 3 if choice.column is Column.SINGLE else 5
    figure = sheet(choice, count * _HIGH + lines(choice, 3.4 + legend_rows(handles, across)))
    panels = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
    dress(choice, *panels)
    for part, (axes, (symbol, unit)) in enumerate(zip(panels, names, strict=True)):
        axes.set_yscale("log")
        shade_busy(axes, timeline, position)
        shade(axes, timeline.attack_intervals(timeline.run.links[position]), timeline)
        axes.plot(times, np.maximum(residual[:, part], FLOOR), color=look(0)[0])
        axes.plot(times, threshold[:, part], color=INK, linestyle="--")
        axes.yaxis.set_minor_locator(NullLocator())
        axes.set_ylim(*log_range(residual[:, part], threshold[:, part]))
        axes.set_ylabel(rf"$|r_{{{symbol}}}|$ [{unit}]")
        mark_alarms(axes, timeline, judged, position, size=0.7 * choice.style.size)
    _name(panels[0], timeline, timeline.run.links[position])
    return _finished(choice, timeline, figure, panels, handles=handles, across=across)


def draw_states(choice: Choice, timeline: Timeline, judged: Judged) -> Figure:
    """Voltage, current and secondary correction of every DGU."""
    curves, dgus = timeline.curves, timeline.run.topics.dgus
    if not timeline.truth:
        raise BagError("states: the bag holds no true states, as one from outside")
    labels = ("$V$ [V]", "$I_t$ [A]")[: curves.x.low.shape[2]]
    quantities: list[tuple[Envelope, tuple[int, ...], str]] = [
        (curves.x, (state,), label) for state, label in enumerate(labels)
    ]
    quantities.append((curves.alpha, (), r"$\alpha$ [V]"))
    handles: list[Line2D | Patch] = [handle(choice, at, f"DGU {dgu}") for at, dgu in enumerate(dgus)]
    if len(dgus) > _MOST_NAMES:
        handles = [handle(choice, 0, f"each of {len(dgus)} DGUs")]
    handles += [attacked()] if any(row.attack.began for row in judged.attacks) else []
    across = 4 if choice.column is Column.SINGLE else 8
    figure = sheet(choice, len(quantities) * _HIGH + lines(choice, 2.4 + legend_rows(handles, across)))
    panels = figure.subplots(len(quantities), 1, sharex=True)
    dress(choice, *panels)
    for axes, (envelope, place, label) in zip(panels, quantities, strict=True):
        _shade_attacks(axes, timeline)
        for at in range(len(dgus)):
            colour, style = look(at)
            axes.plot(envelope.times(timeline.period_sec), envelope.line(at, *place), color=colour, linestyle=style)
        axes.set_ylabel(label)
    return _finished(choice, timeline, figure, panels, handles=handles, across=across)


def draw_impact(choice: Choice, timeline: Timeline, judged: Judged) -> Figure:
    """How far the grid is from its goals, and would have been without a response."""
    if timeline.impact is None:
        raise BagError("impact: the bag holds no true states, as one from outside")
    envelope, without = timeline.curves.impact, unanswered(timeline)
    handles: list[Line2D | Patch] = []
    if without is not None:
        label = "without response"
        handles = [handle(choice, 0, "with response"), Line2D([], [], color=ALERT, linestyle="--", label=label)]
    handles += [attacked()] if any(row.attack.began for row in judged.attacks) else []
    figure = sheet(choice, len(_IMPACTS) * _HIGH + lines(choice, 2.4 + (1 if handles else 0)))
    panels = figure.subplots(len(_IMPACTS), 1, sharex=True)
    dress(choice, *panels)
    for part, (axes, name, label) in enumerate(zip(panels, IMPACTS, _IMPACTS, strict=True)):
        _shade_attacks(axes, timeline)
        if without is not None:
            other = _like(envelope, getattr(without, name))
            axes.plot(other.times(timeline.period_sec), other.line(), color=ALERT, linestyle="--")
        axes.plot(envelope.times(timeline.period_sec), envelope.line(part), color=look(0)[0])
        axes.set_ylabel(label)
    return _finished(choice, timeline, figure, panels, handles=handles, across=3)


def _finished(
    choice: Choice,
    timeline: Timeline,
    figure: Figure,
    panels: NDArray[np.object_],
    *,
    handles: Sequence[Line2D | Patch],
    across: int,
) -> Figure:
    """What panels below each other have in common."""
    panels[-1].set_xlabel(TIME)
    over_time(choice, panels[-1], *_span(timeline))
    figure.align_ylabels(list(panels))
    if handles:
        legend(choice, figure, handles, across)
    return figure


def _single(choice: Choice, timeline: Timeline) -> int:
    """The one link that was asked for, or else the first that there is something to say about."""
    found = choice.positions(timeline)
    if choice.links == ():
        return found[0]
    if len(found) > 1:
        raise BagError(f"components: expected one link, as --links 1-2, not {len(found)}")
    return found[0]


def _span(timeline: Timeline) -> tuple[float, float]:
    """Time that is drawn [s]."""
    score, period_sec = timeline.curves.score, timeline.period_sec
    end = min((score.first_step + len(score.low) * score.length), timeline.steps)
    return score.first_step * period_sec, end * period_sec


def _shade_attacks(axes: Axes, timeline: Timeline) -> None:
    """Shade the time of attacks on any link."""
    shade(axes, [(one.start_step, one.stop_step) for one in timeline.attacks if one.began], timeline)


def _name(axes: Axes, timeline: Timeline, link: Link) -> None:
    """Say which link a panel is of."""
    under = timeline.attack_intervals(link)
    name = rf"link ${link.source} \to {link.target}$" + (", attacked" if under else "")
    axes.set_title(name, loc="left", pad=2.0, color=ALERT if under else INK)


def _like(envelope: Envelope, values: NDArray[np.float64]) -> Envelope:
    """One curve over all steps, thinned as another."""
    steps = len(envelope.low) * envelope.length
    found = Envelope.empty(steps, envelope.length, first_step=envelope.first_step)
    found.add(values, 0)
    return found
