"""Receiver operating characteristics of the residuals of links."""

import numpy as np
from matplotlib.figure import Figure

from bags.mcap.errors import BagError
from bags.reporting.assessment import assess
from bags.reporting.ink import INK, MARKERS, MUTED, look
from bags.reporting.options import ReportOptions
from bags.reporting.publication.choice import Choice
from bags.reporting.publication.sheet import dress, handle, legend, legend_rows, lines, sheet
from bags.reporting.publication.styles import Column
from bags.reporting.timeline import Timeline
from bags.reporting.wording import interval, number

_TALLEST = 2.9  # of the axes [in]
_MOST = 8  # curves that are told apart by their dashes


def draw_roc(choice: Choice, timeline: Timeline, options: ReportOptions) -> Figure:
    """One curve a link that was attacked, its area with an interval, and a mark where its detector worked."""
    scored = {at: one for at, one in enumerate(assess(timeline, options).links) if one.roc is not None}
    wanted = choice.positions(timeline)
    chosen = [one for at, one in scored.items() if at in wanted]
    if not chosen:
        raise BagError("roc: no such link has both attacked and quiet samples with a residual")
    if len(chosen) > _MOST:
        raise BagError(f"roc: {len(chosen)} curves are more than can be told apart ({_MOST}): choose links")
    floor = min(0.5 / max(one.rates.quiet_samples, 1) for one in chosen)
    labels = [
        rf"${one.row.link.source} \to {one.row.link.target}$: AUC {number(one.roc.area.value, 4)} "
        f"{interval(one.roc.area, digits=4)}".rstrip()
        for one in chosen
        if one.roc
    ]
    handles = [handle(choice, at, label) for at, label in enumerate(labels)]
    across = 1 if choice.column is Column.SINGLE else 2
    height = min(0.68 * choice.width, _TALLEST) + lines(choice, 1.0 + legend_rows(handles, across))
    figure = sheet(choice, height)
    axes = figure.subplots()
    dress(choice, axes)
    for at, one in enumerate(chosen):
        if one.roc is None:
            continue
        colour, style = look(at)
        rate = one.roc.false_positive_rate.clip(min=floor)
        axes.plot(rate, one.roc.true_positive_rate, color=colour, linestyle=style, drawstyle="steps-post")
        found, seen = one.rates.false_alarm_rate.value, one.rates.seen_rate.value
        axes.plot([max(found, floor)], [seen], color=colour, marker=MARKERS[at], markersize=5, clip_on=False, zorder=3)
    coin = np.geomspace(floor, 1.0)
    axes.plot(coin, coin, color=MUTED, linestyle=":")
    axes.set_xscale("log")
    axes.set_xlim(floor, 1.0)
    axes.set_ylim(0.0, 1.03)
    axes.set_xlabel("false alarms per quiet sample [1]", color=INK)
    axes.set_ylabel("attacked samples seen [1]", color=INK)
    for at, line in enumerate(handles):
        line.set_marker(MARKERS[at])
        line.set_markersize(4)
    legend(choice, figure, handles, across)
    return figure
