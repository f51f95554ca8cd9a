"""Every measure of a run (theory, section 9), per link and overall."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from bags.reporting.alarm_sources import MAIN, VERDICT
from bags.reporting.attacks import Attack
from bags.reporting.options import ReportOptions
from bags.reporting.timeline import Timeline
from dgu_sim.grid import Link
from monitor.detectors import Phase
from monitor.measures import (
    AlarmRates,
    Batadal,
    Episode,
    Estimate,
    EstimateErrors,
    GridImpact,
    Impact,
    Isolation,
    Roc,
    alarm_rates,
    batadal,
    detect,
    estimate_errors,
    impact_of,
    isolation,
    missed_rate,
    quiet_steps,
    roc,
    under_attack,
)

IMPACTS: Mapping[str, str] = {
    "mean_voltage": "|<V> - <V_ref>| [V]",
    "voltage": "max |V_i - V_ref,i| [V]",
    "sharing": "spread of I/I^r",
}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class LinkAssessment:
    """One directed link.

    Attributes:
        link: The link.
        monitored: Whether it has an observer.
        episodes: Attacks on it.
        rates: Alarms.
        roc: Of its residual, None unless it was attacked.
        batadal: Score.
        left_out_sec: Time for which its receiver left it out of its control [s].
        clear_errors: Of its estimate without attack, None without truth.
        attacked_errors: Under attack: what the lie does to who believes it.
    """

    link: Link
    monitored: bool
    episodes: tuple[Episode, ...]
    rates: AlarmRates
    roc: Roc | None
    batadal: Batadal
    left_out_sec: float
    clear_errors: EstimateErrors | None
    attacked_errors: EstimateErrors | None


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class AttackAssessment:
    """One attack, on however many links.

    Attributes:
        attack: What it was.
        episode: Its detection: the first alarm on any of its links.
        accused: Links that alarmed while it ran.
        impact: By the keys of IMPACTS; none without truth.
        unanswered: What it would have been without a response; none when that is not known.
    """

    attack: Attack
    episode: Episode
    accused: tuple[Link, ...]
    impact: Mapping[str, Impact]
    unanswered: Mapping[str, Impact]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Overall:
    """All links together, by one source of alarms.

    Attributes:
        missed: Share of the attacks that no attacked link showed.
        delay_sec: Mean time to detection of the attacks that were seen [s]; NaN when none was.
        rates: Over the samples of all links.
        roc: Over the samples of all links, for the residual only.
        batadal: Over the attacks and the samples of all links.
        isolation: Which links were accused for which.
    """

    missed: Estimate
    delay_sec: float
    rates: AlarmRates
    roc: Roc | None
    batadal: Batadal
    isolation: Isolation


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Assessment:
    """A run, measured.

    Attributes:
        options: Choices behind the numbers.
        main: The source of alarms that links and attacks are judged by: the verdict where there is one.
        links: In the order of the run's links.
        attacks: By start.
        overall: By source of alarms.
        unanswered: How far the grid would have been from its goals if no DGU had acted on a verdict; None: not known.
    """

    options: ReportOptions
    main: str
    links: tuple[LinkAssessment, ...]
    attacks: tuple[AttackAssessment, ...]
    overall: Mapping[str, Overall]
    unanswered: GridImpact | None


def assess(timeline: Timeline, options: ReportOptions, unanswered: GridImpact | None = None) -> Assessment:
    """Measure a run.

    Args:
        timeline: The run.
        options: Choices behind the measures.
        unanswered: What became of the grid when no DGU acted on a verdict.
    """
    masks = _Masks.of(timeline, options)
    main = VERDICT if VERDICT in timeline.alarms else MAIN
    alarm = timeline.alarms.get(main, np.zeros(masks.attacked.shape, dtype=np.bool_))
    return Assessment(
        options=options,
        main=main,
        links=tuple(_link(timeline, masks, position, alarm) for position in range(len(timeline.run.links))),
        unanswered=unanswered,
        attacks=tuple(_attack(timeline, attack, alarm, masks, unanswered) for attack in timeline.attacks),
        overall={
            name: _overall(timeline, alarms, masks, options, scored=name == MAIN)
            for name, alarms in timeline.alarms.items()
        },
    )


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Masks:
    """Which samples count as what, shape (steps, links), and the lags of the monitors."""

    attacked: NDArray[np.bool_]
    quiet: NDArray[np.bool_]
    block_steps: int
    aftermath_steps: int
    lags: tuple[int, ...]
    period_sec: float
    options: ReportOptions

    @classmethod
    def of(cls, timeline: Timeline, options: ReportOptions) -> "_Masks":
        aftermath = round(options.aftermath_sec / timeline.period_sec)
        shape = timeline.phase.shape
        attacked, quiet = np.zeros(shape, dtype=np.bool_), np.zeros(shape, dtype=np.bool_)
        for position, link in enumerate(timeline.run.links):
            intervals = timeline.attack_intervals(link)
            attacked[:, position] = under_attack(timeline.steps, intervals)
            armed = timeline.phase[:, position] == Phase.ARMED.value
            quiet[:, position] = quiet_steps(armed, intervals, aftermath)
        designs = timeline.run.designs
        return cls(
            attacked=attacked,
            quiet=quiet,
            block_steps=options.block_steps(timeline.steps, timeline.period_sec),
            aftermath_steps=aftermath,
            lags=tuple(designs[link].lag if link in designs else 0 for link in timeline.run.links),
            period_sec=timeline.period_sec,
            options=options,
        )


def _link(timeline: Timeline, masks: _Masks, position: int, alarms: NDArray[np.bool_]) -> LinkAssessment:
    options = masks.options
    link, column = timeline.run.links[position], slice(position, position + 1)
    alarm = alarms[:, column]
    quiet, attacked = masks.quiet[:, column], masks.attacked[:, column]
    episodes = tuple(
        detect(alarm[:, 0], interval, timeline.period_sec, lag=masks.lags[position])
        for interval in timeline.attack_intervals(link)
        if interval[1] > interval[0]
    )
    rates = _rates(alarm, quiet, attacked, masks)
    design = timeline.run.designs.get(link)
    clear, under = timeline.clear_errors.get(link), timeline.attacked_errors.get(link)
    return LinkAssessment(
        link=link,
        monitored=design is not None and design.accepted,
        episodes=episodes,
        rates=rates,
        roc=_roc(timeline.score[:, column], quiet, attacked, masks),
        batadal=batadal(episodes, rates.seen_rate.value, rates.false_alarm_rate.value),
        left_out_sec=float(timeline.left_out[position]) * timeline.period_sec,
        clear_errors=None if clear is None else estimate_errors(clear, seed=options.seed, level=options.level),
        attacked_errors=None if under is None else estimate_errors(under, seed=options.seed, level=options.level),
    )


def _attack(
    timeline: Timeline, attack: Attack, alarm: NDArray[np.bool_], masks: _Masks, unanswered: GridImpact | None
) -> AttackAssessment:
    episode = _seen(timeline, attack, alarm, masks)
    accused = np.asarray(alarm[attack.start_step : attack.stop_step].any(axis=0)).tolist()
    return AttackAssessment(
        attack=attack,
        episode=episode,
        accused=tuple(link for link, one in zip(timeline.run.links, accused, strict=True) if one),
        impact=_impact(timeline.impact, episode, masks),
        unanswered=_impact(unanswered, episode, masks),
    )


def _impact(grid: GridImpact | None, episode: Episode, masks: _Masks) -> Mapping[str, Impact]:
    """Around one attack, by the keys of IMPACTS."""
    interval = (episode.start_step, episode.stop_step)
    if grid is None or interval[1] <= interval[0]:
        return {}
    context = max(masks.aftermath_steps, 1)
    return {
        name: impact_of(getattr(grid, name), interval, episode.alarm_step, masks.period_sec, context_steps=context)
        for name in IMPACTS
    }


def _seen(timeline: Timeline, attack: Attack, alarm: NDArray[np.bool_], masks: _Masks) -> Episode:
    """Detection by any of the attacked links."""
    positions = [timeline.run.links.index(link) for link in attack.links]
    lag = max((masks.lags[position] for position in positions), default=0)
    interval = (attack.start_step, attack.stop_step)
    return detect(np.asarray(alarm[:, positions].any(axis=1)), interval, timeline.period_sec, lag=lag)


def _overall(
    timeline: Timeline, alarm: NDArray[np.bool_], masks: _Masks, options: ReportOptions, *, scored: bool
) -> Overall:
    attacks = [attack for attack in timeline.attacks if attack.stop_step > attack.start_step]
    episodes = [_seen(timeline, attack, alarm, masks) for attack in attacks]
    delays = [one.delay_sec for one in episodes if one.delay_sec is not None]
    rates = _rates(alarm, masks.quiet, masks.attacked, masks)
    found = [
        ([timeline.run.links.index(link) for link in attack.links], one)
        for attack, one in zip(attacks, episodes, strict=True)
    ]
    # a sample counts for isolation when no monitor is in the aftermath of an attack and some monitor judges
    judged = (masks.quiet | masks.attacked | (timeline.phase != Phase.ARMED.value)).all(axis=1)
    judged &= (timeline.phase == Phase.ARMED.value).any(axis=1)
    return Overall(
        missed=missed_rate(episodes, options.level),
        delay_sec=float(np.mean(delays)) if delays else float("nan"),
        rates=rates,
        roc=_roc(timeline.score, masks.quiet, masks.attacked, masks) if scored else None,
        batadal=batadal(episodes, rates.seen_rate.value, rates.false_alarm_rate.value),
        isolation=isolation(alarm, masks.attacked, judged, found, options.level),
    )


def _rates(
    alarm: NDArray[np.bool_], quiet: NDArray[np.bool_], attacked: NDArray[np.bool_], masks: _Masks
) -> AlarmRates:
    options = masks.options
    return alarm_rates(
        alarm,
        quiet,
        attacked,
        masks.period_sec,
        block_steps=masks.block_steps,
        seed=options.seed,
        level=options.level,
    )


def _roc(
    scores: NDArray[np.float32], quiet: NDArray[np.bool_], attacked: NDArray[np.bool_], masks: _Masks
) -> Roc | None:
    options = masks.options
    return roc(scores, attacked, quiet, block_steps=masks.block_steps, seed=options.seed, level=options.level)
