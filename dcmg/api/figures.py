"""Figures of runs for papers."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from bags.reporting.publication import make
from bags.reporting.publication.choice import choice_of
from bags.runs.reader import open_run
from bags.runs.replay import concluded
from bags.runs.run_record import RunRecord

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from bags.runs.reader import Run
    from dgu_sim.grid import Link


def plot(
    run: RunRecord | Run | str | os.PathLike[str],
    figure: str = "residuals",
    *,
    style: str = "ieee",
    column: str = "single",
    links: str | Link | Sequence[Link | str] | None = None,
    start_sec: float | None = None,
    stop_sec: float | None = None,
    out: str | os.PathLike[str] | None = None,
) -> Figure:
    """Draw a run for a paper; what `dcmg plot` writes.

    Args:
        run: a run that was simulated, read or opened, or its bag.
        figure: residuals, components (one link's residual by output, with units), states, roc, topology or impact.
        style: ieee, elsevier, springer or nature: widths, font and size.
        column: single or double.
        links: of which links, as "1-2,4-2" or ["1-2", Link(4, 2)], or "all"; None: those that were attacked or alarmed.
        start_sec: draw from then on [s]; None: from the start.
        stop_sec: draw until then [s]; None: until the end.
        out: file to write, too: .pdf, .svg or .png.

    Returns:
        The figure, to be changed and saved by `dcmg.save_figure`.

    Raises:
        BagError: the bag cannot be read, the run does not hold what was asked for, or the file cannot be written.
    """
    choice = choice_of(figure, style=style, column=column, links=links, start_sec=start_sec, stop_sec=stop_sec)
    if out is not None:
        make.check_path(Path(out))
    opened = open_run(Path(run)) if isinstance(run, (str, os.PathLike)) else run
    windows = [opened] if isinstance(opened, RunRecord) else concluded(opened.windows())
    made = make.make_figure(windows, opened.steps, opened.topics.sampling_period_ns * 1e-9, choice)
    if out is not None:
        make.save(made, Path(out))
    return made


def save_figure(figure: Figure, out: str | os.PathLike[str]) -> None:
    """Write a figure as publishers want it: vectors, fonts embedded (TrueType), no date.

    Args:
        figure: any matplotlib figure, as `dcmg.plot` returns it.
        out: file to write: .pdf, .svg or .png (600 dpi).

    Raises:
        BagError: the file cannot be written, or its name ends otherwise.
    """
    make.save(figure, Path(out))
