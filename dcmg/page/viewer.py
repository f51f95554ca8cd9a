"""What one browser has been sent, and so what it is to be sent next."""

from typing import Literal

import numpy as np

from dcmg.page.board import Board, number, numbers
from dcmg.page.contest import Contest
from dcmg.page.messages import Frame, LinkDetail, LinkState, Series, View
from dcmg.page.source import Driver
from dcmg.page.trace import extremes
from dgu_sim.linear import FloatArray

_LOG_AT_ONCE = 400
_SIZES = (1, 2, 5)
_DGU_PANELS = ("voltage", "current", "alpha")
_MONITORS, _ATTACKERS = frozenset({"alarm", "quiet"}), frozenset({"attack", "over"})
Role = Literal["attacker", "defender"]


class Viewer:
    """Turns what happened into frames for one browser.

    A frame holds everything since the one before, so a browser that is slow loses no number, only pictures.

    Args:
        pace: The clock and what it drives.
        role: Who looks, where a challenge hides things.
    """

    def __init__(self, pace: Driver, role: Role = "attacker") -> None:
        """Nothing has been sent."""
        self._pace, self._role = pace, role
        self._view: View | None = None
        self._sent: dict[str, int] = {}  # by panel: the bin behind the last one sent
        self._line = self._head = 0
        self._version = -1
        self._round: object = 0

    def look(self, view: View) -> None:
        """Send what this view shows, from the beginning of its time axis."""
        self._view, self._version = view, -1
        self._sent.clear()

    def frame(self) -> Frame | None:
        """What is new, None: nothing. The lock is held."""
        pace, view = self._pace, self._view
        if view is None or pace.version == self._version:
            return None
        self._version = pace.version
        board, head = pace.source.board, pace.source.head
        contest = pace.source if isinstance(pace.source, Contest) else None
        round_ = 0 if contest is None else (contest.game_number, contest.over)
        blind, watching = self._hidden(contest)
        back = head < self._head or round_ != self._round
        self._round = round_
        if back:
            self._sent.clear()
            self._line = 0
        anew = self._line == 0
        self._head = head
        log = board.said(self._line, head)[-_LOG_AT_ONCE:]
        self._line = log[-1].number if log else self._line
        if blind or watching:
            unseen = _MONITORS if blind else _ATTACKERS
            log = [one for one in log if one.what not in unseen]
        row = board.trace.at(head - 1)
        voltage, current, alpha = (row[board.channels.dgu(name)] for name in _DGU_PANELS)
        return Frame(
            time=pace.time(),
            voltage=numbers(voltage),
            current=numbers(current),
            alpha=numbers(alpha),
            mean_voltage=number(float(np.mean(voltage))) if len(voltage) else None,
            links=[_seen(one, blind=blind, watching=watching) for one in board.states(head)],
            attacks=[] if watching else board.attacks(head),
            details=[_detail(board, row, name) for name in view.panels if name in _names(board) and not blind],
            series=[
                one
                for panel in view.panels
                if (panel in _DGU_PANELS or not blind) and (one := self._series(board, panel, view, head))
            ],
            log=log,
            log_anew=anew,
            game=None if contest is None else contest.game(),
        )

    def _hidden(self, contest: Contest | None) -> tuple[bool, bool]:
        """Whether what monitors see is hidden, and what attackers do."""
        if contest is None or contest.over:
            return False, False
        return contest.challenge.blind and self._role == "attacker", self._role == "defender"

    def _series(self, board: Board, panel: str, view: View, head: int) -> Series | None:
        size = _bin_steps(view.span_sec / board.sampling_period_sec / view.pixels)
        span = int(view.span_sec / board.sampling_period_sec)
        # what is shown grows by whole bins, and begins where the axis does
        last = head // size
        start = max(0, head - span, board.trace.start) // size
        first = self._sent.get(panel, -1)
        anew = not start <= first <= last
        if anew:
            first = start
        self._sent[panel] = last
        if first == last and not anew:
            return None
        values = _values(board, panel, first * size, last * size)
        if values is None:
            return None
        low, high = (values, None) if size == 1 else extremes(values, size)
        # many numbers, all of them floats: nothing to validate, and JSON has null for what is not finite
        return Series.model_construct(
            panel=panel,
            anew=anew,
            bin_steps=size,
            first_bin=first,
            low=low.tolist(),
            high=None if high is None else high.tolist(),
        )


def _seen(state: LinkState, *, blind: bool, watching: bool) -> LinkState:
    """A link as somebody sees it who does not see everything."""
    if blind:
        return LinkState(state="hidden", attacked=state.attacked, score=None)
    return state.model_copy(update={"attacked": False}) if watching else state


def _bin_steps(wanted: float) -> int:
    """The smallest of 1, 2, 5, 10, 20, ... that is at least as many steps."""
    power = 1
    while True:
        for one in _SIZES:
            if one * power >= wanted:
                return one * power
        power *= 10


def _names(board: Board) -> dict[str, int]:
    return {str(link): at for at, link in enumerate(board.links)}


def _detail(board: Board, row: FloatArray, name: str) -> LinkDetail:
    at = _names(board)[name]
    residual, threshold = (row[board.channels.vector(one, at)] for one in ("residual", "threshold"))
    return LinkDetail(link=name, residual=numbers(residual), threshold=numbers(threshold))


def _values(board: Board, panel: str, first: int, last: int) -> FloatArray | None:
    """Steps of the curves of a panel: of each DGU, of each link, or |r_i| / threshold_i of one link."""
    channels, trace = board.channels, board.trace
    if panel in _DGU_PANELS:
        return trace.span(channels.dgu(panel), first, last)
    if panel == "heat":
        return trace.span(channels.link("score"), first, last)
    at = _names(board).get(panel)
    if at is None:
        return None
    residual, threshold = (trace.span(channels.vector(one, at), first, last) for one in ("residual", "threshold"))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio: FloatArray = np.abs(residual) / threshold
    return ratio
