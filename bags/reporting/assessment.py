"""Every measure of a run (theory, section 9), per link and overall."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bags.reporting.judged import AttackRow, Judged, LinkRow, Masks, judge, seen_by
from bags.reporting.options import ReportOptions
from bags.reporting.timeline import Timeline
from monitor.measures import (
    AlarmRates,
    Batadal,
    Confusion,
    EstimateErrors,
    GridImpact,
    Impact,
    Measured,
    Roc,
    alarm_rates,
    batadal,
    estimate_errors,
    impact_of,
    isolation,
    missed_rate,
    roc,
)

IMPACTS: Mapping[str, str] = {
    "mean_voltage": "|<V> - <V_ref>| [V]",
    "voltage": "max |V_i - V_ref,i| [V]",
    "sharing": "spread of I/I^r",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkAssessment:
    """One directed link.

    Attributes:
        row: What its monitor said.
        rates: Alarms.
        roc: Of its residual, None unless it was attacked.
        batadal: Score.
        left_out_sec: Time for which its receiver left it out of its control [s].
        clear_errors: Of its estimate without attack, None without truth.
        attacked_errors: Under attack: what the lie does to who believes it.
    """

    row: LinkRow
    rates: AlarmRates
    roc: Roc | None
    batadal: Batadal
    left_out_sec: float
    clear_errors: EstimateErrors | None
    attacked_errors: EstimateErrors | None


@dataclass(frozen=True, slots=True, kw_only=True)
class AttackAssessment:
    """One attack, on however many links.

    Attributes:
        row: What became of it.
        impact: By the keys of IMPACTS; none without truth.
        unanswered: What it would have been without a response; none when that is not known.
    """

    row: AttackRow
    impact: Mapping[str, Impact]
    unanswered: Mapping[str, Impact]


@dataclass(frozen=True, slots=True, kw_only=True)
class Overall:
    """All links together, by one source of alarms.

    Attributes:
        missed: Share of the attacks that no attacked link showed.
        delay_sec: Mean time to detection of the attacks that were seen [s]; NaN when none was.
        rates: Over the samples of all links.
        batadal: Over the attacks and the samples of all links.
        isolation: Which links were accused for which.
    """

    missed: Measured
    delay_sec: float
    rates: AlarmRates
    batadal: Batadal
    isolation: Confusion


@dataclass(frozen=True, slots=True, kw_only=True)
class Assessment:
    """A run, measured.

    Attributes:
        options: Choices behind the numbers.
        judged: The rows of its attacks and links.
        links: In the order of the run's links.
        attacks: By start; only those that began.
        overall: By source of alarms.
        unanswered: How far the grid would have been from its goals if no DGU had acted on a verdict; None: not known.
    """

    options: ReportOptions
    judged: Judged
    links: tuple[LinkAssessment, ...]
    attacks: tuple[AttackAssessment, ...]
    overall: Mapping[str, Overall]
    unanswered: GridImpact | None

    @property
    def main(self) -> str:
        """The source of alarms that links and attacks are judged by."""
        return self.judged.main

    @property
    def hardest(self) -> LinkAssessment | None:
        """The attacked link whose residual tells attacked from quiet samples worst; links are not pooled."""
        scored = [one for one in self.links if one.roc is not None]
        return min(scored, key=lambda one: one.roc.area.value if one.roc else 0.0, default=None)


def assess(timeline: Timeline, options: ReportOptions, unanswered: GridImpact | None = None) -> Assessment:
    """Measure a run.

    Args:
        timeline: The run.
        options: Choices behind the measures.
        unanswered: What became of the grid when no DGU acted on a verdict.
    """
    judged = judge(timeline, options)
    began = [row for row in judged.attacks if row.attack.began]
    return Assessment(
        options=options,
        judged=judged,
        links=tuple(_link(timeline, judged, position, options) for position in range(len(judged.links))),
        unanswered=unanswered,
        attacks=tuple(_attack(timeline, row, unanswered, options) for row in began),
        overall={name: _overall(timeline, alarms, judged.masks, options) for name, alarms in timeline.alarms.items()},
    )


def _link(timeline: Timeline, judged: Judged, position: int, options: ReportOptions) -> LinkAssessment:
    row, column = judged.links[position], slice(position, position + 1)
    quiet, attacked = judged.masks.quiet[:, column], judged.masks.attacked[:, column]
    rates = _rates(judged.alarm[:, column], quiet, attacked, timeline, options)
    blocks = options.block_steps(timeline.steps, timeline.period_sec)
    clear, under = timeline.clear_errors.get(row.link), timeline.attacked_errors.get(row.link)
    return LinkAssessment(
        row=row,
        rates=rates,
        roc=roc(timeline.score[:, column], attacked, quiet, block_steps=blocks, seed=options.seed, level=options.level),
        batadal=batadal(row.episodes, rates.seen_rate.value, rates.false_alarm_rate.value),
        left_out_sec=float(timeline.left_out[position]) * timeline.period_sec,
        clear_errors=None if clear is None else estimate_errors(clear, seed=options.seed, level=options.level),
        attacked_errors=None if under is None else estimate_errors(under, seed=options.seed, level=options.level),
    )


def _attack(
    timeline: Timeline, row: AttackRow, unanswered: GridImpact | None, options: ReportOptions
) -> AttackAssessment:
    context = max(round(options.aftermath_sec / timeline.period_sec), 1)

    def around(grid: GridImpact | None) -> Mapping[str, Impact]:
        if grid is None:
            return {}
        interval, alarm_step = (row.attack.start_step, row.attack.stop_step), row.episode.alarm_step
        return {
            name: impact_of(getattr(grid, name), interval, alarm_step, timeline.period_sec, context_steps=context)
            for name in IMPACTS
        }

    return AttackAssessment(row=row, impact=around(timeline.impact), unanswered=around(unanswered))


def _overall(timeline: Timeline, alarm: NDArray[np.bool_], masks: Masks, options: ReportOptions) -> Overall:
    attacks = [attack for attack in timeline.attacks if attack.began]
    episodes = [seen_by(timeline, attack, alarm, masks) for attack in attacks]
    delays = [one.delay_sec for one in episodes if one.delay_sec is not None]
    rates = _rates(alarm, masks.quiet, masks.attacked, timeline, options)
    # a sample counts for isolation when its link is not in the aftermath of an attack and some monitor judges
    judged = ~masks.aftermath & masks.armed.any(axis=1, keepdims=True)
    intervals = [(attack.start_step, attack.stop_step) for attack in attacks]
    return Overall(
        missed=missed_rate(episodes, options.level),
        delay_sec=float(np.mean(delays)) if delays else float("nan"),
        rates=rates,
        batadal=batadal(episodes, rates.seen_rate.value, rates.false_alarm_rate.value),
        isolation=isolation(alarm, masks.attacked, judged, intervals, options.level),
    )


def _rates(
    alarm: NDArray[np.bool_],
    quiet: NDArray[np.bool_],
    attacked: NDArray[np.bool_],
    timeline: Timeline,
    options: ReportOptions,
) -> AlarmRates:
    return alarm_rates(
        alarm,
        quiet,
        attacked,
        timeline.period_sec,
        block_steps=options.block_steps(timeline.steps, timeline.period_sec),
        seed=options.seed,
        level=options.level,
    )
