"""C's delayed observer as a link monitor's: from the history alone, estimate max(delta - 1, 0) steps late.

Its residual y - C xhat of the estimate's instant is the innovation of the window equations, (y window) - Theta xhat,
minus what the gain takes of it: unknown inputs that are cancelled exactly do not move it; others move it by
`guarantee.residual_bound` at most, while they stay as small as in the history.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic.dataclasses import dataclass as checked_dataclass

from monitor.delayed.data_driven import KIND, HistoryOptions, design_chosen
from monitor.options import STRICT, parse_options

if TYPE_CHECKING:
    from collections.abc import Mapping

    from monitor.history import History
    from monitor.observer import Design


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class LinkOptions(HistoryOptions):
    """Options of the delayed observer of a link.

    Attributes:
        allow_blind: accept an observer whose residual can show nothing, for its estimate.
    """

    allow_blind: bool = False


def design(history: History, options: Mapping[str, object]) -> Design:
    """Design the delayed observer from a history; a refusal is a value.

    Raises:
        MonitorError: an option that does not fit.
    """
    chosen = parse_options(LinkOptions, options, KIND)
    return design_chosen(history, chosen).as_design().unless_blind(allow=chosen.allow_blind)
