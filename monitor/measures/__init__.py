"""What a run was worth to a defender: detection, false alarms, isolation, impact, estimates (theory, section 9).

Pure functions of arrays, one measure a file. Nothing on the hot path imports them.
"""

from monitor.measures.batadal import Batadal, batadal
from monitor.measures.contrast import more_often, trials_needed
from monitor.measures.edges import changed, onsets, spans
from monitor.measures.episodes import Episode, detect, missed_rate
from monitor.measures.estimation import ErrorSums, EstimateErrors, estimate_errors
from monitor.measures.false_alarms import AlarmRates, alarm_rates, quiet_steps, under_attack
from monitor.measures.impact import GridImpact, Impact, grid_impact, impact_of
from monitor.measures.intervals import (
    Interval,
    Measured,
    block_bootstrap,
    block_sums,
    clopper_pearson,
    mean_time_between,
    median,
)
from monitor.measures.isolation import Confusion, isolation
from monitor.measures.roc import Roc, roc
from monitor.measures.score import score

__all__ = [
    "AlarmRates",
    "Batadal",
    "Confusion",
    "Episode",
    "ErrorSums",
    "EstimateErrors",
    "GridImpact",
    "Impact",
    "Interval",
    "Measured",
    "Roc",
    "alarm_rates",
    "batadal",
    "block_bootstrap",
    "block_sums",
    "changed",
    "clopper_pearson",
    "detect",
    "estimate_errors",
    "grid_impact",
    "impact_of",
    "isolation",
    "mean_time_between",
    "median",
    "missed_rate",
    "more_often",
    "onsets",
    "quiet_steps",
    "roc",
    "score",
    "spans",
    "trials_needed",
    "under_attack",
]
