"""What journals ask of a figure: the width of a column, the font and its size."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, Final

_MM: Final = 1.0 / 25.4  # inches
_TIMES: Final = ("STIXGeneral", "stix")  # both come with matplotlib: a figure looks the same on every machine
_SANS: Final = ("DejaVu Sans", "dejavusans")


class Column(Enum):
    """How many columns of the page a figure is wide."""

    SINGLE = "single"
    DOUBLE = "double"


@dataclass(frozen=True, slots=True, kw_only=True)
class Style:
    """How the figures of one publisher look.

    Attributes:
        name: On the command line.
        single: Width of a column [in].
        double: Width of the type area [in].
        tallest: Height of the type area [in].
        fonts: Of text, and of mathematics.
        size: Of all that is written [pt].
        line: Width of curves [pt].
    """

    name: str
    single: float
    double: float
    tallest: float
    fonts: tuple[str, str]
    size: float
    line: float

    def width(self, column: Column) -> float:
        """Width of a figure [in]."""
        return self.single if column is Column.SINGLE else self.double

    def settings(self) -> dict[Any, Any]:
        """What matplotlib is told, as rcParams."""
        return {
            "font.family": self.fonts[0],
            "mathtext.fontset": self.fonts[1],
            "font.size": self.size,
            "axes.labelsize": self.size,
            "axes.titlesize": self.size,
            "legend.fontsize": self.size - 1.0,
            "axes.linewidth": 0.6,
            "axes.labelpad": 2.0,
            "lines.linewidth": self.line,
            "lines.dashed_pattern": (4.0, 1.6),
            "xtick.major.width": 0.6,
            "ytick.major.width": 0.6,
            "figure.constrained_layout.h_pad": 0.02,
            "figure.constrained_layout.w_pad": 0.02,
            "figure.constrained_layout.hspace": 0.02,
            "figure.constrained_layout.wspace": 0.02,
        }


STYLES: Final[Mapping[str, Style]] = {
    one.name: one
    for one in (
        Style(name="ieee", single=3.5, double=7.16, tallest=9.0, fonts=_TIMES, size=8.0, line=0.9),
        Style(name="elsevier", single=90 * _MM, double=190 * _MM, tallest=240 * _MM, fonts=_TIMES, size=8.0, line=0.9),
        Style(name="springer", single=84 * _MM, double=174 * _MM, tallest=234 * _MM, fonts=_SANS, size=7.0, line=0.9),
        Style(name="nature", single=89 * _MM, double=183 * _MM, tallest=225 * _MM, fonts=_SANS, size=6.5, line=0.8),
    )
}
"""From the guides for authors of these publishers; the fonts are the nearest that matplotlib brings."""
