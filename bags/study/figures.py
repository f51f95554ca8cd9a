"""Pictures and tables of a study."""

import csv
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from bags.reporting.ink import INK, MARKERS, MUTED, look, prepare
from bags.study.settings import NO_ATTACK
from bags.study.summary import Comparison, OperatingPoint
from monitor.measures import Measured

_PANELS = 4


def write_results(
    points: Sequence[OperatingPoint], comparisons: Sequence[Comparison], limit: float, out: Path
) -> tuple[Path, ...]:
    """Write comparison.csv, comparison.md and the pictures of each condition.

    Args:
        points: All operating points.
        comparisons: What is best against each attack.
        limit: The false-alarm rate that `comparisons` accepts.
        out: An existing folder.

    Returns:
        The paths.
    """
    paths = [out / "comparison.csv", out / "comparison.md"]
    rows = [point.row() for point in points]
    with paths[0].open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    paths[1].write_text(markdown(comparisons, limit), encoding="utf-8")
    for condition in dict.fromkeys(point.condition for point in points):
        mine = [point for point in points if point.condition == condition and point.attack != NO_ATTACK]
        if mine:
            suffix = condition.replace(" ", "_").replace("/", "_")
            for name in QUANTITIES:
                paths.append(out / f"{name}_{suffix}.png")
                _draw(mine, name, condition, paths[-1])
    return tuple(paths)


def markdown(comparisons: Sequence[Comparison], limit: float) -> str:
    """Return the comparison as a Markdown table."""
    title = f"Best observer and detector with at most {limit:g} false alarms per sample; 95 % intervals in brackets."
    rule = "|---" * len(COLUMNS) + "|"
    lines = (f"| {' | '.join(cells(one))} |" for one in comparisons)
    return "\n".join([title, "", f"| {' | '.join(COLUMNS)} |", rule, *lines]) + "\n"


COLUMNS = (
    "condition",
    "attack",
    "best",
    "detected",
    "delay [s]",
    "false-alarm rate",
    "mean-voltage error until then [V]",
    "in the whole run [V]",
)
"""Columns of the comparison."""


def cells(one: Comparison) -> tuple[str, ...]:
    """Return one row of the comparison as text."""
    best, whole = one.best, shown(one.mean_voltage_v)
    if best is None:
        return (one.condition, one.attack, one.nobody, "", "", "", "", whole)
    swept = "" if best.swept is None else f" at {best.swept:g}"
    estimates = (best.detected, best.delay_sec, best.false_alarm_rate, best.mean_voltage_until_alarm_v)
    name = f"{best.observer} + {best.detector}{swept}"
    return (one.condition, one.attack, name, *(shown(one) for one in estimates), whole)


def shown(estimate: Measured) -> str:
    """Return an estimate as text."""
    if math.isnan(estimate.value):
        return "-"
    if estimate.interval is None:
        return f"{estimate.value:.3g}"
    return f"{estimate.value:.3g} [{estimate.interval.low:.2g}, {estimate.interval.high:.2g}]"


_LARGEST_MARK, _LEAST_MARK = 10.0, 4.0

QUANTITIES: Mapping[str, tuple[str, str]] = {
    "roc": ("detected", "share of the runs detected [1]"),
    "delay": ("delay_sec", "median time to detection [s]"),
    "impact": ("mean_voltage_until_alarm_v", r"$|\langle V\rangle - \langle V_{ref}\rangle|$ until the alarm [V]"),
}
"""What is drawn over the false-alarm rate: field of an OperatingPoint, and its label with unit."""


def _draw(points: Sequence[OperatingPoint], name: str, title: str, path: Path) -> None:
    """Draw one panel an attack: dashes are detectors, markers observers, bars 95 % intervals."""
    attacks = list(dict.fromkeys(point.attack for point in points))
    columns = min(_PANELS, len(attacks))
    rows = math.ceil(len(attacks) / columns)
    figure = Figure(figsize=(3.6 * columns + 2.6, 2.9 * rows + 0.9), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False)
    for panel, attack in zip(grid.flat, attacks, strict=False):
        draw_panel(panel, [one for one in points if one.attack == attack], name, lines_of(points))
        panel.set_title(attack, fontsize=9, color=INK)
    for panel in list(grid.flat)[len(attacks) :]:
        panel.set_axis_off()
    figure.suptitle(title, fontsize=11, color=INK)
    figure.supxlabel("false alarms per armed sample [1]", fontsize=9, color=INK)
    figure.supylabel(QUANTITIES[name][1], fontsize=9, color=INK)
    figure.legend(handles=handles_of(lines_of(points)), loc="outside right upper", fontsize=7, frameon=False)
    figure.savefig(path, dpi=130)


def lines_of(points: Sequence[OperatingPoint]) -> list[tuple[str, str]]:
    """Observer and detector of each curve, in order of appearance."""
    return list(dict.fromkeys((point.observer, point.detector) for point in points))


def handles_of(lines: Sequence[tuple[str, str]]) -> list[Line2D]:
    """Entries of a legend."""
    return [Line2D([], [], label=f"{one} + {two}", **_style((one, two), lines)) for one, two in lines]


def _style(line: tuple[str, str], lines: Sequence[tuple[str, str]]) -> dict[str, Any]:
    observers, detectors = (list(dict.fromkeys(names)) for names in zip(*lines, strict=True))
    colour, dash = look(lines.index(line))[0], look(detectors.index(line[1]))[1]
    marker = MARKERS[observers.index(line[0]) % len(MARKERS)]
    size = _LARGEST_MARK - (_LARGEST_MARK - _LEAST_MARK) * lines.index(line) / max(len(lines) - 1, 1)
    return {
        "color": colour,
        "linestyle": dash,
        "marker": marker,
        "markersize": size,  # points on one spot stand around each other
        "markerfacecolor": "none",
        "linewidth": 1.2,
    }


def draw_panel(
    panel: Axes, points: Sequence[OperatingPoint], name: str, lines: Sequence[tuple[str, str]], prefix: str = ""
) -> None:
    """Draw one quantity of one attack; a rate or a time of 0 stands where its axis says 0.

    Args:
        panel: Where.
        points: The points of that attack.
        name: A key of QUANTITIES.
        lines: All curves there are, for their looks.
        prefix: Of the ids of the curves in an SVG file; "": none.
    """
    prepare(panel)
    field = QUANTITIES[name][0]
    rates = [point.false_alarm_rate.value for point in points]
    x_zero = _with_zero(panel, "x", rates)
    values = [getattr(point, field) for point in points]
    known = [one.value for one in values if math.isfinite(one.value)]
    y_zero = 0.0 if name == "roc" else _with_zero(panel, "y", known)
    for number, line in enumerate(lines):
        mine = sorted(
            (one for one in points if (one.observer, one.detector) == line), key=lambda one: one.false_alarm_rate.value
        )
        found = [getattr(one, field) for one in mine]
        x = [max(one.false_alarm_rate.value, x_zero) for one in mine]
        y = [max(one.value, y_zero) for one in found]
        limits = [(one.interval.low, one.interval.high) if one.interval else (one.value, one.value) for one in found]
        below = [max(value - max(low, y_zero), 0.0) for value, (low, _) in zip(y, limits, strict=True)]
        above = [max(high - value, 0.0) for value, (_, high) in zip(y, limits, strict=True)]
        drawn = panel.errorbar(
            x, y, yerr=[below, above], capsize=2, elinewidth=0.8, clip_on=False, zorder=3, **_style(line, lines)
        )
        if prefix:
            for part in (drawn.lines[0], *drawn.lines[1], *drawn.lines[2]):
                part.set_gid(f"{prefix}-{number}")
    if name == "roc":
        panel.set_ylim(0.0, 1.0)
    elif not known:
        panel.text(0.5, 0.5, "never detected", transform=panel.transAxes, ha="center", color=MUTED, fontsize=9)


def _with_zero(panel: Axes, axis: str, values: Sequence[float]) -> float:
    """Make an axis logarithmic, with a place for 0 below the smallest value; return that place."""
    positive = [value for value in values if value > 0.0 and math.isfinite(value)]
    least, most = (min(positive), max(positive)) if positive else (1e-3, 1e-2)
    zero = 10.0 ** (math.floor(math.log10(least)) - 1)
    top = 10.0 ** math.ceil(math.log10(most) + 1e-9)
    exponents = range(round(math.log10(zero)), round(math.log10(top)) + 1)
    step = max(1, len(exponents) // 4)
    ticks = [10.0**one for one in exponents if one == exponents[0] or (one - exponents[0]) % step == 0]
    labels = ["0", *(f"{tick:g}" if tick >= 1e-3 else f"$10^{{{round(math.log10(tick))}}}$" for tick in ticks[1:])]  # noqa: PLR2004 - shorter so
    getattr(panel, f"set_{axis}scale")("log")
    getattr(panel, f"set_{axis}lim")(zero, top)
    getattr(panel, f"set_{axis}ticks")(ticks, labels)
    getattr(panel, f"{axis}axis").set_minor_locator(NullLocator())
    return zero
