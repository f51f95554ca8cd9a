"""Colours, dashes and axes that the PNG pictures of runs and studies share."""

from typing import Final

from matplotlib.axes import Axes

# Okabe and Ito's palette, readable with any colour vision; its vermilion is kept for attacks and alarms
COLOURS: Final = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#7F7F00", "#332288", "#999999")
# offset and lengths of dashes and gaps: with them curves are told apart in grey too
DASHES: Final[tuple[tuple[float, tuple[float, ...]], ...]] = (
    (0, ()),
    (0, (6, 2)),
    (0, (1, 1.2)),
    (0, (6, 1.5, 1, 1.5)),
    (0, (3, 1)),
    (0, (3, 1, 1, 1, 1, 1)),
    (0, (10, 2)),
    (0, (1, 3)),
)
MARKERS: Final = "osD^vP*X"
ALERT: Final = "#D55E00"
ALERT_SHADE: Final = "#F8DFCC"
BUSY: Final = "#E8EBEE"
INK: Final = "#222222"
MUTED: Final = "#777777"


def look(position: int) -> tuple[str, tuple[float, tuple[float, ...]]]:
    """Colour and line style of a DGU, or of a curve of a study."""
    return COLOURS[position % len(COLOURS)], DASHES[(position + position // len(COLOURS)) % len(DASHES)]


def prepare(axes: Axes, *, size: float = 8.0) -> None:
    """Give axes their looks, with ticks written in `size` points."""
    axes.grid(visible=True, color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(colors=MUTED, labelsize=size)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(MUTED)
