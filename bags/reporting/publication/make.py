"""A run → the figure that was asked for → a file that a publisher takes."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bags.mcap.errors import BagError
from bags.reporting.judged import Judged, judge
from bags.reporting.options import DEFAULTS
from bags.reporting.publication.choice import Choice, Kind
from bags.reporting.publication.graph import draw_topology
from bags.reporting.publication.over_time import draw_components, draw_impact, draw_residuals, draw_states
from bags.reporting.publication.roc import draw_roc
from bags.reporting.timeline import Timeline, gather
from bags.runs.run_record import RunRecord

FORMATS: Final = (".pdf", ".svg", ".png")
_DPI: Final = 600  # of PNG, what publishers ask of line art
_SAVED: Final[dict[Any, Any]] = {
    "pdf.fonttype": 42,  # whole TrueType fonts: publishers refuse the Type 3 that matplotlib makes by default
    "svg.fonttype": "path",  # letters as outlines: no font is needed to see them
    "svg.hashsalt": "dcmg",  # names inside the file: the same each time
}
_SAYS: Final[Mapping[str, Mapping[str, str | None]]] = {  # no date: the same run gives the same bytes
    ".pdf": {"Creator": "dcmg", "CreationDate": None},
    ".svg": {"Creator": "dcmg", "Date": None},
    ".png": {"Software": "dcmg"},
}
_DRAWN: Final[Mapping[Kind, Callable[[Choice, Timeline, Judged], Figure]]] = {
    Kind.RESIDUALS: draw_residuals,
    Kind.COMPONENTS: draw_components,
    Kind.STATES: draw_states,
    Kind.TOPOLOGY: draw_topology,
    Kind.IMPACT: draw_impact,
    Kind.ROC: lambda choice, timeline, _: draw_roc(choice, timeline, DEFAULTS),
}


def make_figure(windows: Iterable[RunRecord], steps: int, period_sec: float, choice: Choice) -> Figure:
    """Draw a run.

    Args:
        windows: Its consecutive windows; at least one.
        steps: Its complete steps.
        period_sec: T_s [s].
        choice: What is drawn, and how.

    Returns:
        The figure, as wide as a column of the style.

    Raises:
        BagError: A window cannot be read, or the run does not hold what was asked for.
    """
    timeline = gather(windows, steps, drawn=choice.steps(steps, period_sec))
    with mpl.rc_context(choice.style.settings()):
        figure = _DRAWN[choice.kind](choice, timeline, judge(timeline))
        FigureCanvasAgg(figure)
        figure.draw_without_rendering()  # the layout and the ticks are made now, with the fonts of the style
    return figure


def check_path(path: Path) -> None:
    """Refuse a file that could not be written as a figure.

    Raises:
        BagError: Its name does not end as that of a format we write.
    """
    if path.suffix.lower() not in FORMATS:
        raise BagError(f"{path}: expected a name that ends in {', '.join(FORMATS[:-1])} or {FORMATS[-1]}")


def save(figure: Figure, path: Path) -> None:
    """Write a figure: fonts embedded, no date, so the same figure gives the same bytes.

    Args:
        figure: The figure.
        path: Where to, .pdf, .svg or .png; folders are made.

    Raises:
        BagError: The file cannot be written, or its name ends otherwise.
    """
    check_path(path)
    suffix = path.suffix.lower()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with mpl.rc_context(_SAVED):
            figure.savefig(path, format=suffix[1:], dpi=_DPI, metadata=dict(_SAYS[suffix]))
    except OSError as error:
        raise BagError(f"{path}: the figure cannot be written: {error.strerror}") from None
