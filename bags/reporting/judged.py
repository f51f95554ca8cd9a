"""The one measured truth of a run: a row for each attack and one for each link, shown alike wherever they appear."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bags.reporting.alarm_sources import MAIN, VERDICT
from bags.reporting.attacks import Attack
from bags.reporting.options import DEFAULTS, ReportOptions
from bags.reporting.plain import plain
from bags.reporting.timeline import Timeline
from dgu_sim.attacks.techniques import techniques_of
from dgu_sim.grid import Link
from monitor.detectors import Phase
from monitor.measures import Episode, detect, onsets, quiet_steps, under_attack


@dataclass(frozen=True, slots=True, kw_only=True)
class Masks:
    """Which samples count as what, shape (steps, links), and how late each monitor tells by design.

    Attributes:
        attacked: Falsified.
        quiet: Armed, not attacked and not just after an attack: an alarm there is false.
        aftermath: Just after an attack on that link: held neither for nor against a monitor.
        armed: Where the link's monitor judges.
        lags: Steps, of each link.
    """

    attacked: NDArray[np.bool_]
    quiet: NDArray[np.bool_]
    aftermath: NDArray[np.bool_]
    armed: NDArray[np.bool_]
    lags: tuple[int, ...]

    @classmethod
    def of(cls, timeline: Timeline, options: ReportOptions) -> "Masks":
        """The masks of a run."""
        links, designs = timeline.run.links, timeline.run.designs
        behind = round(options.aftermath_sec / timeline.period_sec)
        armed = np.asarray(timeline.phase == Phase.ARMED.value)
        attacked, quiet, free = (np.zeros(armed.shape, dtype=np.bool_) for _ in range(3))
        everywhere = np.ones(timeline.steps, dtype=np.bool_)
        for position, link in enumerate(links):
            intervals = timeline.attack_intervals(link)
            attacked[:, position] = under_attack(timeline.steps, intervals)
            free[:, position] = quiet_steps(everywhere, intervals, behind)
        quiet = armed & free
        lags = tuple(designs[link].lag if link in designs else 0 for link in links)
        return cls(attacked=attacked, quiet=quiet, aftermath=~(attacked | free), armed=armed, lags=lags)


@dataclass(frozen=True, slots=True, kw_only=True)
class AttackRow:
    """What became of one attack.

    Attributes:
        attack: What it was, and whether it began at all.
        episode: When it ran, and the first alarm on any of its links.
        accused_by: Its link that alarmed first, None when it was missed.
        accused: Its links that alarmed while it ran.
        wrongly_accused: Links that alarmed while it ran and no attack was on them or just over.
        calibrating: Whether the detectors of its links still learned when it began: they took it for normal.
        delays_sec: Time to detection by each source of alarms [s], None where that source missed it.
    """

    attack: Attack
    episode: Episode
    accused_by: Link | None
    accused: tuple[Link, ...]
    wrongly_accused: tuple[Link, ...]
    calibrating: bool
    delays_sec: Mapping[str, float | None]

    @property
    def stop_sec(self) -> float | None:
        """When it stopped [s], None: it ran until the end, or never began."""
        return self.episode.start_sec + self.episode.duration_sec if self.attack.stopped else None

    @property
    def alarm_sec(self) -> float | None:
        """When it was first seen [s]."""
        delay = self.episode.delay_sec
        return None if delay is None else self.episode.start_sec + delay

    def document(self) -> dict[str, Any]:
        """The row of every JSON document."""
        attack, episode = self.attack, self.episode
        return {
            "number": attack.number,
            "kind": attack.kind,
            "techniques": [str(one) for one in techniques_of(attack.kind)],
            "links": [str(link) for link in attack.links],
            "origin": attack.origin,
            "parameters": json.loads(attack.parameters or "{}"),
            "began": attack.began,
            "from_sec": _seconds(episode.start_sec),
            "to_sec": _seconds(self.stop_sec),
            "seen": episode.detected if attack.began else None,
            "alarm_sec": _seconds(self.alarm_sec),
            "delay_sec": _seconds(episode.delay_sec),
            "accused_by": None if self.accused_by is None else str(self.accused_by),
            "accused": [str(link) for link in self.accused],
            "calibrating": self.calibrating,
            "wrongly_accused": [str(link) for link in self.wrongly_accused],
            "delay_by_source_sec": {name: _seconds(late) for name, late in self.delays_sec.items()},
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkRow:
    """What the monitor of one directed link said.

    Attributes:
        link: The link.
        monitored: False when no observer could be designed.
        observer: Name of the design method.
        verdict: What the design says about itself.
        episodes: Attacks on it, and whether it showed them.
        alarms: Alarms that began while it was armed and neither attacked nor just behind an attack.
        first_alarm_sec: The first alarm of any kind [s].
        quiet_score: Largest |r_i| / threshold_i where an alarm would be false; NaN without one.
        attacked_score: The same under attack.
        threshold: Last thresholds; NaN where there is none.
    """

    link: Link
    monitored: bool
    observer: str
    verdict: str
    episodes: tuple[Episode, ...]
    alarms: int
    first_alarm_sec: float | None
    quiet_score: float
    attacked_score: float
    threshold: tuple[float, ...]

    @property
    def seen(self) -> int:
        """How many of the attacks on it it showed."""
        return sum(one.detected for one in self.episodes)

    def document(self, *, labelled: bool) -> dict[str, Any]:
        """The row of every JSON document; alarms are false only where somebody knows what was attacked."""
        return {
            "link": str(self.link),
            "monitored": self.monitored,
            "observer": self.observer,
            "verdict": self.verdict,
            "attacks": len(self.episodes),
            "seen": self.seen,
            "alarms": self.alarms,
            "false_alarms": self.alarms if labelled else None,
            "first_alarm_sec": _seconds(self.first_alarm_sec),
            "quiet_score": plain(self.quiet_score),
            "attacked_score": plain(self.attacked_score),
            "threshold": plain(self.threshold),
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """A run, judged.

    Attributes:
        main: The source of alarms that it is judged by: the verdict where there is one.
        alarm: Alarms of that source, shape (steps, links).
        masks: Which samples count as what.
        attacks: By start; those that never began too.
        links: In the order of the run's links.
    """

    main: str
    alarm: NDArray[np.bool_]
    masks: Masks
    attacks: tuple[AttackRow, ...]
    links: tuple[LinkRow, ...]


def judge(timeline: Timeline, options: ReportOptions = DEFAULTS) -> Judged:
    """Judge a run."""
    masks = Masks.of(timeline, options)
    main = VERDICT if VERDICT in timeline.alarms else MAIN
    alarm = timeline.alarms.get(main, np.zeros(masks.attacked.shape, dtype=np.bool_))
    return Judged(
        main=main,
        alarm=alarm,
        masks=masks,
        attacks=tuple(_attack(timeline, attack, alarm, masks) for attack in timeline.attacks),
        links=tuple(_link(timeline, position, alarm[:, position], masks) for position in range(alarm.shape[1])),
    )


def seen_by(timeline: Timeline, attack: Attack, alarm: NDArray[np.bool_], masks: Masks) -> Episode:
    """Detection of an attack by any of its links."""
    positions = [timeline.run.links.index(link) for link in attack.links]
    lag = max((masks.lags[position] for position in positions), default=0)
    interval = (attack.start_step, attack.stop_step)
    return detect(np.asarray(alarm[:, positions].any(axis=1)), interval, timeline.period_sec, lag=lag)


def _attack(timeline: Timeline, attack: Attack, alarm: NDArray[np.bool_], masks: Masks) -> AttackRow:
    episode = seen_by(timeline, attack, alarm, masks)
    links = timeline.run.links
    own = [link for link in links if link in attack.links]
    during = slice(attack.start_step, attack.stop_step + max((masks.lags[links.index(one)] for one in own), default=0))
    first = None
    if episode.alarm_step is not None:
        first = next(link for link in own if alarm[episode.alarm_step, links.index(link)])
    phases = timeline.phase[attack.start_step : attack.start_step + 1, [links.index(link) for link in own]]
    others = np.asarray((alarm & ~masks.attacked & ~masks.aftermath)[during].any(axis=0)).tolist()
    return AttackRow(
        attack=attack,
        episode=episode,
        accused_by=first,
        accused=tuple(link for link in own if alarm[during, links.index(link)].any()),
        wrongly_accused=tuple(link for link, wrong in zip(links, others, strict=True) if wrong),
        calibrating=bool((phases == Phase.CALIBRATING.value).any()),
        delays_sec={name: seen_by(timeline, attack, by, masks).delay_sec for name, by in timeline.alarms.items()},
    )


def _link(timeline: Timeline, position: int, alarm: NDArray[np.bool_], masks: Masks) -> LinkRow:
    link, quiet, score = timeline.run.links[position], masks.quiet[:, position], timeline.score[:, position]
    design = timeline.run.designs.get(link)
    raised = np.flatnonzero(alarm)
    last = timeline.run.threshold[-1:, position]
    return LinkRow(
        link=link,
        monitored=design is not None and design.accepted,
        observer="" if design is None else design.observer,
        verdict="the bag holds no design" if design is None else design.verdict,
        episodes=tuple(
            detect(alarm, interval, timeline.period_sec, lag=masks.lags[position])
            for interval in timeline.attack_intervals(link)
            if interval[1] > interval[0]
        ),
        alarms=int(np.count_nonzero(onsets(alarm) & quiet)),
        first_alarm_sec=int(raised[0]) * timeline.period_sec if len(raised) else None,
        quiet_score=_largest(score[quiet]),
        attacked_score=_largest(score[masks.attacked[:, position]]),
        threshold=tuple(last[0].tolist()) if len(last) else (),
    )


def _largest(values: NDArray[np.float32]) -> float:
    return float(np.fmax.reduce(values, initial=np.nan))


def _seconds(time_sec: float | None) -> float | None:
    """A time as people write it: nanoseconds, and no rounding of binary fractions."""
    return None if time_sec is None else round(time_sec, 9)
