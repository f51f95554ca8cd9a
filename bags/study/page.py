"""A study as one HTML page: who sees which attack, side by side, and the curves behind each cell."""

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from jinja2 import Environment
from markupsafe import Markup
from matplotlib.figure import Figure

from bags.reporting.ink import INK, MUTED
from bags.reporting.page import resource
from bags.study.figures import QUANTITIES, draw_panel, handles_of, lines_of, shown
from bags.study.settings import NO_ATTACK, Study
from bags.study.summary import Comparison, OperatingPoint

PAGE = "study.html"


@dataclass(frozen=True, slots=True, kw_only=True)
class MatrixCell:
    """One observer and detector against one attack.

    Attributes:
        point: Its best operating point within the false-alarm limit, None: none keeps it.
        share: Detected, with its interval, in words.
        state: good (seen in nearly all runs), some, or none.
    """

    point: OperatingPoint | None
    share: str
    state: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One attack in one condition.

    Attributes:
        name: Of its curves in the page.
        condition: The condition.
        attack: The attack.
        best: What is best, or why nobody is.
        cells: By the columns of the matrix.
        curves: SVG.
    """

    name: str
    condition: str
    attack: str
    best: str
    cells: tuple[MatrixCell, ...]
    curves: Markup


def write_page(
    study: Study, points: Sequence[OperatingPoint], comparisons: Sequence[Comparison], out: Path | str
) -> Path:
    """Write study.html, which opens without a network.

    Args:
        study: What was asked.
        points: All operating points.
        comparisons: What is best against each attack.
        out: An existing folder.
    """
    out = Path(out)
    columns = lines_of(points)
    rows = []
    for number, one in enumerate(comparisons):
        mine = [p for p in points if (p.condition, p.attack) == (one.condition, one.attack)]
        if one.attack == NO_ATTACK:
            continue
        best = one.nobody if one.best is None else f"{one.best.observer} + {one.best.detector}"
        cells = tuple(_cell([p for p in mine if (p.observer, p.detector) == line], study) for line in columns)
        curves = _curves(mine, columns, f"curve-{number}")
        name = f"attack-{number}"
        rows.append(Row(name=name, condition=one.condition, attack=one.attack, best=best, cells=cells, curves=curves))
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    text = resources.files("bags.study").joinpath("page.html.j2").read_text(encoding="utf-8")
    page = environment.from_string(text).render(
        study=study,
        columns=columns,
        rows=rows,
        conditions=list(dict.fromkeys(row.condition for row in rows)),
        shown=shown,
        style=Markup(resource("style.css")),  # noqa: S704 - ours
        behaviour=Markup(resource("behaviour.js")),  # noqa: S704 - ours
    )
    (out / PAGE).write_text(page, encoding="utf-8")
    return out / PAGE


def _cell(points: Sequence[OperatingPoint], study: Study) -> MatrixCell:
    kept = [point for point in points if point.false_alarm_rate.value <= study.false_alarm_limit]
    if not kept:
        return MatrixCell(point=None, share="too many false alarms", state="none")
    best = max(kept, key=lambda point: (point.seen, point.detected.value, -_or_inf(point.delay_sec.value)))
    state = "none" if not best.seen else "good" if best.detected.value >= 0.9 else "some"  # noqa: PLR2004 - nearly all
    return MatrixCell(point=best, share=shown(best.detected), state=state)


def _or_inf(value: float) -> float:
    return math.inf if math.isnan(value) else value


def _curves(points: Sequence[OperatingPoint], lines: Sequence[tuple[str, str]], prefix: str) -> Markup:
    """The three quantities of one attack over the false-alarm rate, in the colours of the page."""
    figure = Figure(figsize=(11.0, 3.3), layout="constrained")
    for panel, name in zip(figure.subplots(1, 3), QUANTITIES, strict=True):
        draw_panel(panel, points, name, lines, prefix=f"{prefix}-{name}")
        panel.set_ylabel(QUANTITIES[name][1], fontsize=9, color=INK)
        panel.set_xlabel("false alarms per armed sample [1]", fontsize=9, color=INK)
    handles = handles_of(lines)
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=8, frameon=False, labelcolor=INK)
    text = io.StringIO()
    figure.savefig(text, format="svg", transparent=True, metadata={"Date": None})
    svg = text.getvalue()
    svg = svg[svg.index("<svg") :].replace(INK, "currentColor").replace(MUTED, "var(--muted)")
    # ids of several figures in one page must not meet
    for before in ('id="', "url(#", 'href="#'):
        svg = svg.replace(before, f"{before}{prefix}_")
    return Markup(svg.replace("#dddddd", "var(--line)"))  # noqa: S704 - ours
