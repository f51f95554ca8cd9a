"""Pictures and tables of a study."""

import csv
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bags.study.settings import NO_ATTACK
from bags.study.summary import Comparison, OperatingPoint
from monitor.measures import Measured

_PANELS = 4
_MARKERS = "osD^vP*X"
_STYLES = ("-", "--", ":", "-.")


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
            for name, draw in (("roc", _roc), ("delay", _delay), ("impact", _impact)):
                paths.append(out / f"{name}_{suffix}.png")
                _draw(mine, draw, f"{condition}: {_TITLES[name]}", paths[-1])
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


_TITLES = {
    "roc": "share of the runs detected over the false-alarm rate",
    "delay": "median time to detection over the false-alarm rate",
    "impact": "mean-voltage error until the alarm over the false-alarm rate",
}


def _draw(
    points: Sequence[OperatingPoint],
    draw: Callable[[Axes, Sequence[OperatingPoint], Any], None],
    title: str,
    path: Path,
) -> None:
    """Draw one panel an attack: colours are detectors, line styles and markers observers."""
    attacks = list(dict.fromkeys(point.attack for point in points))
    columns = min(_PANELS, len(attacks))
    rows = math.ceil(len(attacks) / columns)
    figure = Figure(figsize=(3.6 * columns + 2.4, 2.8 * rows + 0.8), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True)
    lines = list(dict.fromkeys((point.observer, point.detector) for point in points))
    observers, detectors = (list(dict.fromkeys(names)) for names in zip(*lines, strict=True))
    for panel, attack in zip(panels.flat, attacks, strict=False):
        for observer, detector in lines:
            mine = [p for p in points if (p.attack, p.observer, p.detector) == (attack, observer, detector)]
            kind = observers.index(observer)
            style = {
                "color": f"C{detectors.index(detector) % 10}",
                "linestyle": _STYLES[kind % len(_STYLES)],
                "marker": _MARKERS[kind % len(_MARKERS)],
                "label": f"{observer} + {detector}",
                "markersize": 4,
                "linewidth": 1.2,
            }
            draw(panel, sorted(mine, key=lambda point: point.false_alarm_rate.value), style)
        panel.set_title(attack, fontsize=9)
        panel.set_xscale("symlog", linthresh=1e-5)
        panel.set_xlim(left=0.0)
        panel.grid(alpha=0.3)
    for panel in list(panels.flat)[len(attacks) :]:
        panel.set_visible(False)
    figure.suptitle(title, fontsize=11)
    figure.supxlabel("false-alarm rate per sample", fontsize=9)
    handles, labels = panels.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right upper", fontsize=7)
    figure.savefig(path, dpi=110)


def _roc(panel: Axes, points: Sequence[OperatingPoint], style: Any) -> None:  # noqa: ANN401 - matplotlib's keywords
    panel.plot([p.false_alarm_rate.value for p in points], [p.detected.value for p in points], **style)
    panel.set_ylim(-0.05, 1.05)


def _delay(panel: Axes, points: Sequence[OperatingPoint], style: Any) -> None:  # noqa: ANN401 - matplotlib's keywords
    panel.plot([p.false_alarm_rate.value for p in points], [p.delay_sec.value for p in points], **style)
    panel.set_yscale("symlog", linthresh=0.01)


def _impact(panel: Axes, points: Sequence[OperatingPoint], style: Any) -> None:  # noqa: ANN401 - matplotlib's keywords
    values = [p.mean_voltage_until_alarm_v.value for p in points]
    panel.plot([p.false_alarm_rate.value for p in points], values, **style)
