"""The score of the BATADAL competition (Taormina et al., J. Water Resour. Plann. Manage. 144(8), 2018)."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from monitor.measures.episodes import Episode


@dataclass(frozen=True, slots=True, kw_only=True)
class Batadal:
    """S = .5 S_TTD + .5 S_CM; NaN where there was no attack, or no quiet time.

    Attributes:
        s_ttd: 1 - mean(TTD / duration), a missed attack counts its whole duration.
        s_cm: (TPR + TNR) / 2 over samples.
        score: their mean.
    """

    s_ttd: float
    s_cm: float
    score: float


def batadal(episodes: Sequence[Episode], seen_rate: float, false_alarm_rate: float) -> Batadal:
    """Score of one link, or of all.

    Args:
        episodes: the attacks.
        seen_rate: TPR, share of attacked samples with an alarm.
        false_alarm_rate: 1 - TNR, share of quiet samples with an alarm.
    """
    if not episodes:
        return Batadal(s_ttd=nan, s_cm=nan, score=nan)
    spent = [1.0 if one.delay_sec is None else min(one.delay_sec / one.duration_sec, 1.0) for one in episodes]
    s_ttd = 1.0 - sum(spent) / len(spent)
    s_cm = (seen_rate + 1.0 - false_alarm_rate) / 2.0
    return Batadal(s_ttd=s_ttd, s_cm=s_cm, score=0.5 * s_ttd + 0.5 * s_cm)
