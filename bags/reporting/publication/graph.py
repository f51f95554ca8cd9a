"""The grid as a graph: DGUs, power lines, communication links, which of them were attacked and which accused."""

from collections.abc import Mapping
from typing import Any, Final, Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, FancyArrowPatch
from matplotlib.path import Path

from bags.mcap.yaml_text import load
from bags.reporting.ink import ALERT, COLOURS, INK, MUTED
from bags.reporting.judged import Judged
from bags.reporting.publication.choice import Choice
from bags.reporting.publication.sheet import legend, legend_rows, lines, sheet
from bags.reporting.timeline import Timeline
from bags.reporting.topology import SIZE, Drawing, drawing

_Dashes = Literal["-", "--", "-.", ":"] | tuple[float, tuple[float, ...]]
_TALLEST: Final = 3.2  # of the drawing [in]
_STATES: Final[
    Mapping[str, tuple[str, str, float, _Dashes]]
] = {  # words, colour, width and dashes: not told by colour alone
    "hit": ("attacked, seen", ALERT, 1.8, "-"),
    "partly": ("attacked, partly seen", ALERT, 1.8, "-."),
    "missed": ("attacked, missed", ALERT, 1.8, "--"),
    "false": ("accused, not attacked", COLOURS[0], 1.4, (0, (3, 1, 1, 1))),
    "quiet": ("not accused", INK, 0.7, "-"),
    "unmonitored": ("not monitored", MUTED, 0.7, ":"),
}
_LINE: Final[dict[str, Any]] = {"color": "#B8B8B8", "linewidth": 3.0, "solid_capstyle": "round"}


def draw_topology(choice: Choice, timeline: Timeline, judged: Judged) -> Figure:
    """DGUs on a circle, power lines between them, and an arrow for each communication link."""
    shape = drawing(timeline, judged)
    wired = _lines(timeline, shape)
    found = [state for state in _STATES if state in {arrow.state for arrow in shape.arrows}]
    handles = [_handle(state) for state in found]
    if wired:
        handles.append(Line2D([], [], label="power line", **_LINE))
    across = 2 if choice.width < _TALLEST * 1.5 else 4
    side = min(choice.width, _TALLEST)
    figure = sheet(choice, side + lines(choice, 0.4 + legend_rows(handles, across)))
    axes = figure.subplots()
    scale = side * 72.0 / SIZE  # points of the paper per unit of the drawing
    for one, two in wired:
        axes.plot([one[0], two[0]], [one[1], two[1]], zorder=0, **_LINE)
    _draw(axes, shape, scale, choice.style.size)
    axes.set_xlim(0.0, SIZE)
    axes.set_ylim(SIZE, 0.0)
    axes.set_aspect("equal")
    axes.set_axis_off()
    legend(choice, figure, handles, across)
    return figure


def _draw(axes: Axes, shape: Drawing, scale: float, size: float) -> None:
    for arrow in shape.arrows:
        _, colour, width, style = _STATES[arrow.state]
        path = Path(list(arrow.points), [Path.MOVETO, Path.CURVE3, Path.CURVE3])
        axes.add_patch(
            FancyArrowPatch(
                path=path,
                arrowstyle="-|>",
                mutation_scale=4.0 + 2.5 * width,
                color=colour,
                linewidth=width,
                linestyle=style,
                shrinkA=0.0,
                shrinkB=0.0,
                zorder=2,
            )
        )
    for node in shape.nodes:
        axes.add_patch(
            Circle((node.x, node.y), shape.radius, facecolor="white", edgecolor=INK, linewidth=1.0, zorder=3)
        )
        if shape.radius * scale > 0.6 * size:
            axes.text(node.x, node.y, str(node.number), ha="center", va="center_baseline", fontsize=size + 1, zorder=4)


def _handle(state: str) -> Line2D:
    words, colour, width, style = _STATES[state]
    return Line2D([], [], color=colour, linewidth=width, linestyle=style, label=words)


def _lines(timeline: Timeline, shape: Drawing) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Ends of the power lines, as far as the bag's scenario tells them."""
    document: Any = load(timeline.run.scenario_text) if timeline.run.scenario_text else None
    told = document.get("lines") if isinstance(document, dict) else None
    places = {node.number: (node.x, node.y) for node in shape.nodes}
    pairs = [one.get("between") for one in told or () if isinstance(one, dict)]
    return [
        (places[pair[0]], places[pair[1]])
        for pair in pairs
        if isinstance(pair, list) and len(pair) == 2 and set(pair) <= set(places)  # noqa: PLR2004 - a line has two ends
    ]
