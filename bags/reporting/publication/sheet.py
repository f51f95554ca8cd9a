"""An empty figure in the width of a column, and what all figures have in common."""

from collections.abc import Sequence
from typing import Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from bags.mcap.errors import BagError
from bags.reporting.ink import ALERT_SHADE, INK, look, prepare
from bags.reporting.publication.choice import Choice
from bags.reporting.publication.styles import Column

TIME: Final = "simulated time [s]"
_LINE: Final = 1.45 / 72.0  # height of a line of text of 1 pt [in]


def sheet(choice: Choice, height: float) -> Figure:
    """An empty figure.

    Raises:
        BagError: It would be taller than a page.
    """
    if height > choice.style.tallest:
        raise BagError(
            f"{choice.kind.value}: {height:.1f} in are more than a page of {choice.style.name} "
            f"({choice.style.tallest:.1f} in): choose fewer links, or two columns"
        )
    return Figure(figsize=(choice.width, height), layout="constrained")


def lines(choice: Choice, count: float) -> float:
    """Height of so many lines of text [in]."""
    return count * _LINE * choice.style.size


def dress(choice: Choice, *many: Axes) -> None:
    """Give axes their looks."""
    for axes in many:
        prepare(axes, size=choice.style.size - 1.0)
        axes.tick_params(labelfontfamily=choice.style.fonts[0], length=2.5, pad=2.0, colors=INK)
        axes.xaxis.label.set_color(INK)
        axes.yaxis.label.set_color(INK)


def over_time(choice: Choice, axes: Axes, start_sec: float, stop_sec: float) -> None:
    """Time on the horizontal axis."""
    axes.set_xlim(start_sec, stop_sec)
    axes.xaxis.set_major_locator(MaxNLocator(6 if choice.column is Column.SINGLE else 10))


def legend(choice: Choice, figure: Figure, handles: Sequence[Line2D | Patch], columns: int) -> None:
    """Explain the marks above the figure."""
    figure.legend(
        handles=list(handles),
        loc="outside upper center",
        ncols=min(columns, len(handles)),
        frameon=False,
        fontsize=choice.style.size - 1.0,
        handlelength=2.6,
        columnspacing=1.2,
        borderaxespad=0.1,
        labelspacing=0.3,
    )


def legend_rows(handles: Sequence[object], columns: int) -> int:
    """How many lines of text a legend takes."""
    return -(-len(handles) // min(columns, len(handles)))


def handle(choice: Choice, position: int, label: str) -> Line2D:
    """Line of a curve in a legend, in the colour and dashes of `ink.look`."""
    colour, style = look(position)
    return Line2D([], [], color=colour, linestyle=style, linewidth=1.2 * choice.style.line, label=label)


def attacked() -> Patch:
    """The shade of attacks in a legend."""
    return Patch(color=ALERT_SHADE, label="attack")
