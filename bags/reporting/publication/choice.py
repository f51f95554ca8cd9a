"""What a figure for a paper shall show, checked before anything is read or drawn."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from math import isfinite

import numpy as np

from bags.mcap.errors import BagError
from bags.reporting.publication.styles import STYLES, Column, Style
from bags.reporting.timeline import Timeline
from dgu_sim.errors import AttackError
from dgu_sim.grid import Link
from dgu_sim.suggestions import meant

_UNASKED = 4  # links that are drawn of a run in which nothing was attacked and nobody alarmed


class Kind(Enum):
    """What is drawn."""

    RESIDUALS = "residuals"
    COMPONENTS = "components"
    STATES = "states"
    ROC = "roc"
    TOPOLOGY = "topology"
    IMPACT = "impact"


OF_LINKS = frozenset({Kind.RESIDUALS, Kind.COMPONENTS, Kind.ROC})
"""Figures of which one may choose the links."""
OVER_TIME = frozenset({Kind.RESIDUALS, Kind.COMPONENTS, Kind.STATES, Kind.IMPACT})
"""Figures of which one may choose the time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """A figure that was asked for.

    Attributes:
        kind: What is drawn.
        style: How.
        column: How wide.
        links: Of which links; None: all; empty: those that there is something to say about.
        start_sec: From when on; None: the start of the run [s].
        stop_sec: Until when; None: the end of the run [s].
    """

    kind: Kind
    style: Style
    column: Column = Column.SINGLE
    links: tuple[Link, ...] | None = ()
    start_sec: float | None = None
    stop_sec: float | None = None

    @property
    def width(self) -> float:
        """Of the figure [in]."""
        return self.style.width(self.column)

    def steps(self, steps: int, period_sec: float) -> tuple[int, int]:
        """Steps [start, stop) that are drawn of a run of so many.

        Raises:
            BagError: There are none.
        """
        end_sec = steps * period_sec
        start, stop = self.start_sec or 0.0, end_sec if self.stop_sec is None else self.stop_sec
        if not steps:
            raise BagError("the run holds no complete step: there is nothing to draw")
        if not (isfinite(start) and isfinite(stop) and 0.0 <= start < stop) or start >= end_sec:
            raise BagError(
                f"from {start:g} s to {stop:g} s: expected a time within the run, which lasts from 0 s to {end_sec:g} s"
            )
        first = min(round(start / period_sec), steps - 1)
        return first, max(min(round(stop / period_sec), steps), first + 1)

    def positions(self, timeline: Timeline) -> list[int]:
        """Positions of the links that are drawn, in the order of the run's links.

        Raises:
            BagError: The run has no links, or not those.
        """
        known = timeline.run.links
        if not known:
            raise BagError(f"{self.kind.value}: the run has no links")
        if self.links is None:
            return list(range(len(known)))
        for link in self.links:
            if link not in known:
                near = meant(link, map(str, known))
                raise BagError(f"link {link}: {near + ' ' if near else ''}the run has {', '.join(map(str, known))}")
        return [at for at, link in enumerate(known) if link in self.links] or _telling(timeline)


def choice_of(
    figure: str,
    *,
    style: str,
    column: str = "single",
    links: str | Link | Sequence[Link | str] | None = None,
    start_sec: float | None = None,
    stop_sec: float | None = None,
) -> Choice:
    """Understand what was asked for.

    Raises:
        BagError: A figure, style or column that there is not, or what does not go with this figure.
    """
    kind = Kind(_one_of("figure", figure, [one.value for one in Kind]))
    if links is not None and kind not in OF_LINKS:
        raise BagError(f"{kind.value}: links are not chosen; they are of {_names(OF_LINKS)}")
    if (start_sec, stop_sec) != (None, None) and kind not in OVER_TIME:
        raise BagError(f"{kind.value}: a time is not chosen; it is of {_names(OVER_TIME)}")
    return Choice(
        kind=kind,
        style=STYLES[_one_of("style", style, list(STYLES))],
        column=Column(_one_of("column", column, [one.value for one in Column])),
        links=_links(links),
        start_sec=start_sec,
        stop_sec=stop_sec,
    )


def _one_of(what: str, word: str, known: Sequence[str]) -> str:
    if word in known:
        return word
    near = meant(word, known)
    raise BagError(f"{what} {word!r}: {near + ' ' if near else ''}expected one of {', '.join(known)}")


def _names(kinds: Iterable[Kind]) -> str:
    return ", ".join(one.value for one in Kind if one in kinds)


def _links(links: str | Link | Sequence[Link | str] | None) -> tuple[Link, ...] | None:
    """Links of "1-2,3-4", or of a list; None for "all"."""
    if links is None:
        return ()
    given = links.split(",") if isinstance(links, str) else [links] if isinstance(links, Link) else links
    if [str(one).strip() for one in given] == ["all"]:
        return None
    try:
        found = [one if isinstance(one, Link) else Link.parse(one) for one in given]
    except AttackError as error:
        raise BagError(f"{error}, several as 1-2,3-4, or all") from None
    return tuple(dict.fromkeys(found))


def _telling(timeline: Timeline) -> list[int]:
    """Links that were attacked or alarmed; of a quiet run, those whose residuals came closest to an alarm."""
    alarmed = np.zeros(len(timeline.run.links), dtype=np.bool_)
    for alarms in timeline.alarms.values():
        alarmed |= alarms.any(axis=0)
    told = [at for at, link in enumerate(timeline.run.links) if timeline.attack_intervals(link) or alarmed[at]]
    peak = np.nan_to_num(np.fmax.reduce(timeline.score, axis=0, initial=0.0))
    return told or sorted(np.argsort(-peak, kind="stable")[:_UNASKED].tolist())
