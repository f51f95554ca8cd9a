"""From the table of a study to operating points with intervals, and to what is best against which attack."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from bags.study.runs import IMPACTS, Runs, runs_of
from bags.study.settings import NO_ATTACK
from monitor.measures import Measured, block_bootstrap, clopper_pearson, median, more_often, trials_needed
from monitor.measures.contrast import LIMIT, TRIALS

_SEED = 0  # of the bootstrap: a table has one summary


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatingPoint:
    """One observer and one setting of one detector against one attack, over all seeds.

    Attributes:
        condition: Name of the condition.
        observer: Name of the observer.
        detector: Name of the detector.
        swept: Value of the swept option, None: as the study gives the detector.
        attack: Name of the attack.
        accepted: Share of the links that an observer was designed for.
        runs: How many runs.
        false_alarm_rate: Share of armed attack-free samples with an alarm; bootstrap over the seeds, ten or more, whose
            runs are independent while their samples are not; without any alarm the exact limit for independent samples.
        detected: Share of the runs in which an attacked link alarmed during the attack; Clopper-Pearson.
        by_chance: Share of the runs without the attack in which one of the same links alarmed in the same window: a
            detection that happens as often says nothing; Clopper-Pearson.
        delay_sec: Median time from the attack's start to that alarm, among the runs that saw it [s]; order statistics.
        wrong_accusations: Share of the runs in which a link that is not attacked alarmed during the attack;
            Clopper-Pearson.
        mean_voltage_until_alarm_v: Largest |<V> - <V_ref>| until that alarm, or the end, median of the runs [V];
            order statistics.
        mean_voltage_v: The same for the whole run.
        sharing_until_alarm: Largest minus smallest I_t / I^r until that alarm, or the end, median; order statistics.
        sharing: The same for the whole run.
    """

    condition: str
    observer: str
    detector: str
    swept: float | None
    attack: str
    accepted: float
    runs: int
    false_alarm_rate: Measured
    detected: Measured
    by_chance: Measured
    delay_sec: Measured
    wrong_accusations: Measured
    mean_voltage_until_alarm_v: Measured
    mean_voltage_v: Measured
    sharing_until_alarm: Measured
    sharing: Measured

    @property
    def hits(self) -> tuple[int, int]:
        """Runs that were detected, and runs without the attack in which the same links alarmed."""
        detected, by_chance = (round(one.value * self.runs) for one in (self.detected, self.by_chance))
        return detected, by_chance

    @property
    def seen(self) -> bool:
        """Whether the attack is detected more often than its absence: Fisher's exact test, one-sided, at 2.5 %."""
        return more_often(*self.hits, self.runs) < LIMIT

    def row(self) -> dict[str, object]:
        """Return the point as one flat row."""
        found: dict[str, object] = {}
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if isinstance(value, Measured):
                low, high = (np.nan, np.nan) if value.interval is None else (value.interval.low, value.interval.high)
                found |= {name: value.value, f"{name}_low": low, f"{name}_high": high}
            else:
                found[name] = value
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """What is best against one attack, among the points whose false-alarm rate is within the limit.

    Attributes:
        condition: Name of the condition.
        attack: Name of the attack.
        best: Of the points that see the attack, the one with most runs detected, then the shortest delay; None: none.
        candidates: How many points kept the limit.
        nobody: Why there is no best one, in words; "" where there is one.
        mean_voltage_v: Largest |<V> - <V_ref>| of a run in which nobody acts [V].
        sharing: Largest minus smallest I_t / I^r of such a run.
    """

    condition: str
    attack: str
    best: OperatingPoint | None
    candidates: int
    nobody: str
    mean_voltage_v: Measured
    sharing: Measured


def operating_points(tables: Iterable[pa.Table]) -> tuple[OperatingPoint, ...]:
    """Return every combination in the tables; those of one observer and detector against one attack are neighbours.

    Args:
        tables: All rows, those of one condition and observer neighbours, those of one seed in one table; they are not
            kept.
    """
    points: list[OperatingPoint] = []
    pairs = ((pair, runs) for table in tables for pair, runs in runs_of(table))
    for (condition, observer), several in groupby(pairs, key=itemgetter(0)):
        gathered: dict[tuple[str, float | None], list[Runs]] = {}
        for _, by_detector in several:
            for point, runs in by_detector.items():
                gathered.setdefault(point, []).append(runs)
        for (detector, swept), parts in gathered.items():
            names = {"condition": condition, "observer": observer, "detector": detector, "swept": swept}
            points += _points(names, Runs.joined(parts))
    return tuple(points)


def compare(points: Sequence[OperatingPoint], false_alarm_limit: float) -> tuple[Comparison, ...]:
    """Return the best point against every attack in every condition."""

    def goodness(point: OperatingPoint) -> tuple[float, float, float]:
        delay = point.delay_sec.value
        return (-point.detected.value, np.inf if np.isnan(delay) else delay, point.false_alarm_rate.value)

    found = []
    for condition, attack in dict.fromkeys((point.condition, point.attack) for point in points):
        mine = [point for point in points if (point.condition, point.attack) == (condition, attack)]
        kept = [point for point in mine if point.false_alarm_rate.value <= false_alarm_limit]
        best = min((point for point in kept if point.seen), key=goodness, default=None)
        found.append(
            Comparison(
                condition=condition,
                attack=attack,
                best=best,
                candidates=len(kept),
                nobody="" if best is not None else _nobody(kept),
                mean_voltage_v=mine[0].mean_voltage_v,
                sharing=mine[0].sharing,
            )
        )
    return tuple(found)


def _nobody(kept: Sequence[OperatingPoint]) -> str:
    """Say why no point is best: nobody keeps the limit, the seeds cannot tell, or nobody sees the attack."""
    if not kept:
        return "nobody keeps the limit"
    hopeful = max(kept, key=lambda point: point.detected.value - point.by_chance.value)
    hits, runs = hopeful.hits, hopeful.runs
    needed = trials_needed(*hits, runs)
    if needed is not None:
        return f"too few seeds to tell ({runs}; {needed} would)"
    if more_often(runs, 0, runs) >= LIMIT:  # not even a detection in every run would show
        return f"too few seeds to tell ({runs}; {TRIALS[0]} might)"
    return f"nobody sees it ({hits[0]} of {runs} runs, {hits[1]} without the attack)"


def _points(names: Mapping[str, Any], runs: Runs) -> Iterator[OperatingPoint]:
    """Put the runs of each attack together."""
    free = runs.attacks.index(NO_ATTACK)
    rate = _false_alarm_rate(runs.clean_alarm_steps[free], runs.clean_steps[free])
    for at, attack in enumerate(runs.attacks):
        if at == free and len(runs.attacks) > 1:
            continue
        seen, chance, accused = (one[at] for one in (runs.seen, runs.by_chance, runs.accused))
        yield OperatingPoint(
            **names,
            attack=attack,
            accepted=float(runs.accepted[at].sum() / (runs.links * len(seen))),
            runs=len(seen),
            false_alarm_rate=rate,
            detected=clopper_pearson(int(seen.sum()), len(seen)),
            by_chance=clopper_pearson(int(chance.sum()), len(chance)),
            delay_sec=median(runs.delay_sec[at][seen]),
            wrong_accusations=clopper_pearson(int(accused.sum()), len(accused)),
            **dict[str, Any]({name: median(runs.impact[name][at]) for name in IMPACTS}),
        )


def _false_alarm_rate(alarms: NDArray[np.int64], steps: NDArray[np.int64]) -> Measured:
    """Return the share of attack-free armed samples with an alarm, from the runs without any attack."""
    if steps.sum() and not alarms.sum():
        return clopper_pearson(0, int(steps.sum()))
    return block_bootstrap(alarms.astype(np.float64), steps.astype(np.float64), seed=_SEED)
