"""Tables in the terminal: nothing is cut short, whatever its width; brackets are brackets; numbers stay in one line."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.box import HEAVY_HEAD
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

__all__ = ["tabulate"]


def tabulate(
    headings: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    numbers: Collection[str] = (),
    styles: Iterable[str | None] | None = None,
    title: str = "",
    framed: bool = True,
) -> Table:
    """Lay out a table that folds where it is too narrow.

    Args:
        headings: of the columns, each with its unit.
        rows: cells of each.
        numbers: headings of columns to the right, whose cells are not folded: an exponent belongs to its number.
        styles: of the rows, None: plain.
        title: above it, "": none.
        framed: with lines around the cells.
    """
    cells = [list(row) for row in rows]
    table = Table(
        title=Text(title, style="table.title") if title else None,
        title_justify="left",
        box=HEAVY_HEAD if framed else None,
    )
    for at, heading in enumerate(headings):
        number = heading in numbers
        table.add_column(
            Text(heading),
            overflow="fold",
            justify="right" if number else "left",
            min_width=max((len(row[at]) for row in cells), default=0) if number else None,
        )
    for row, style in zip(cells, styles or [None] * len(cells), strict=True):
        table.add_row(*map(Text, row), style=style)
    return table
