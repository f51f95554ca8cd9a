"""From the table of a study to operating points with intervals, and to what is best against which attack."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from scipy import stats

from bags.study.settings import NO_ATTACK

_CONFIDENCE = 0.95
_RESAMPLES = 2000
_SEED = 0  # of the bootstrap: a table has one summary


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """An estimate with its 95 % interval; NaN where there is none."""

    value: float
    low: float
    high: float


@final
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
        false_alarm_rate: Share of armed attack-free samples with an alarm; bootstrap over the seeds, whose runs are
            independent while their samples are not; without any alarm the exact limit for independent samples.
        detected: Share of the runs in which an attacked link alarmed during the attack; Clopper-Pearson.
        by_chance: Share of the runs without the attack in which one of the same links alarmed in the same window: a
            detection that happens as often says nothing; Clopper-Pearson.
        delay_sec: Median time from the attack's start to that alarm, among the runs that saw it [s]; bootstrap.
        wrong_accusations: Share of the runs in which a link that is not attacked alarmed during the attack;
            Clopper-Pearson.
        mean_voltage_until_alarm_v: Largest |<V> - <V_ref>| until that alarm, or the end, median of the runs [V];
            bootstrap.
        mean_voltage_v: The same for the whole run.
        sharing_until_alarm: Largest minus smallest I_t / I^r until that alarm, or the end, median; bootstrap.
        sharing: The same for the whole run.
    """

    condition: str
    observer: str
    detector: str
    swept: float | None
    attack: str
    accepted: float
    runs: int
    false_alarm_rate: Interval
    detected: Interval
    by_chance: Interval
    delay_sec: Interval
    wrong_accusations: Interval
    mean_voltage_until_alarm_v: Interval
    mean_voltage_v: Interval
    sharing_until_alarm: Interval
    sharing: Interval

    @property
    def seen(self) -> bool:
        """Whether the attack is detected more often than its absence: Fisher's exact test, one-sided, at 2.5 %."""
        hits = [round(one.value * self.runs) for one in (self.detected, self.by_chance)]
        table = np.array([[count, self.runs - count] for count in hits])
        return bool(stats.fisher_exact(table, alternative="greater").pvalue < (1.0 - _CONFIDENCE) / 2.0)

    def row(self) -> dict[str, object]:
        """Return the point as one flat row."""
        found: dict[str, object] = {}
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if isinstance(value, Interval):
                found |= {name: value.value, f"{name}_low": value.low, f"{name}_high": value.high}
            else:
                found[name] = value
        return found


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """What is best against one attack, among the points whose false-alarm rate is within the limit.

    Attributes:
        condition: Name of the condition.
        attack: Name of the attack.
        best: Of the points that see the attack, the one with most runs detected, then the shortest delay; None: none.
        candidates: How many points kept the limit.
        mean_voltage_v: Largest |<V> - <V_ref>| of a run in which nobody acts [V].
        sharing: Largest minus smallest I_t / I^r of such a run.
    """

    condition: str
    attack: str
    best: OperatingPoint | None
    candidates: int
    mean_voltage_v: Interval
    sharing: Interval


def operating_points(table: pa.Table) -> tuple[OperatingPoint, ...]:
    """Return every combination in the table; those of one observer and detector against one attack are neighbours."""
    columns = {name: table.column(name).to_numpy(zero_copy_only=False) for name in table.column_names}
    keys = list(zip(columns["condition"], columns["observer"], columns["detector"], columns["swept"], strict=True))
    points = []
    for (condition, observer, detector, swept), rows in _grouped(keys).items():
        part = {name: column[rows] for name, column in columns.items()}
        rate = _false_alarm_rate(part)
        for attack in dict.fromkeys(part["attack"]):
            if attack == NO_ATTACK and len(set(part["attack"])) > 1:
                continue
            mine = {name: column[part["attack"] == attack] for name, column in part.items()}
            names = {"condition": condition, "observer": observer, "detector": detector, "swept": swept}
            points.append(_point(names, attack, mine, rate, _by_chance(part, mine)))
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
                mean_voltage_v=mine[0].mean_voltage_v,
                sharing=mine[0].sharing,
            )
        )
    return tuple(found)


def _grouped(keys: Sequence[tuple[Any, ...]]) -> dict[tuple[Any, ...], NDArray[np.int64]]:
    """Return the rows of each key, NaN standing for None, in order of appearance."""
    clean = [tuple(None if isinstance(part, float) and np.isnan(part) else part for part in key) for key in keys]
    found: dict[tuple[Any, ...], list[int]] = {}
    for key, rows in groupby(range(len(clean)), key=clean.__getitem__):
        found.setdefault(key, []).extend(rows)
    return {key: np.array(rows) for key, rows in found.items()}


def _by_chance(rows: Mapping[str, NDArray[Any]], attacked: Mapping[str, NDArray[Any]]) -> Interval:
    """Return how often the attacked links alarm in the window of the attack when there is none."""
    under = attacked["attacked"].astype(bool)
    links = set(zip(attacked["source"][under], attacked["target"][under], strict=True))
    same = np.array([link in links for link in zip(rows["source"], rows["target"], strict=True)])
    free = (rows["attack"] == NO_ATTACK) & same
    hits = [bool(rows["detected"][free & (rows["seed"] == seed)].any()) for seed in dict.fromkeys(rows["seed"])]
    return _share(sum(hits), len(hits))


def _point(
    names: Mapping[str, Any], attack: str, rows: Mapping[str, NDArray[Any]], rate: Interval, chance: Interval
) -> OperatingPoint:
    """Put the runs of one attack together."""
    attacked = rows["attacked"].astype(bool)
    by_seed = [rows["seed"] == seed for seed in dict.fromkeys(rows["seed"])]
    seen = [bool(rows["detected"][one & attacked].any()) for one in by_seed]
    accused = [bool(rows["detected"][one & ~attacked].any()) for one in by_seed]
    delays = [
        float(np.nanmin(rows["delay_sec"][one & attacked])) for one, hit in zip(by_seed, seen, strict=True) if hit
    ]
    first = np.array([int(np.flatnonzero(one)[0]) for one in by_seed])
    return OperatingPoint(
        **names,
        attack=attack,
        accepted=float(rows["accepted"].mean()),
        runs=len(by_seed),
        false_alarm_rate=rate,
        detected=_share(sum(seen), len(seen)),
        by_chance=chance,
        delay_sec=_median(delays),
        wrong_accusations=_share(sum(accused), len(accused)),
        mean_voltage_until_alarm_v=_median(rows["mean_voltage_until_alarm_v"][first]),
        mean_voltage_v=_median(rows["mean_voltage_v"][first]),
        sharing_until_alarm=_median(rows["sharing_until_alarm"][first]),
        sharing=_median(rows["sharing"][first]),
    )


def _false_alarm_rate(rows: Mapping[str, NDArray[Any]]) -> Interval:
    """Return the share of attack-free armed samples with an alarm, from the runs without any attack."""
    free = rows["attack"] == NO_ATTACK
    seeds = list(dict.fromkeys(rows["seed"][free]))
    alarms = np.array([rows["clean_alarm_steps"][free & (rows["seed"] == seed)].sum() for seed in seeds])
    steps = np.array([rows["clean_steps"][free & (rows["seed"] == seed)].sum() for seed in seeds])
    total = int(steps.sum())
    if not total:
        return Interval(value=np.nan, low=np.nan, high=np.nan)
    if not alarms.sum():
        return _share(0, total)
    value = float(alarms.sum() / total)
    low, high = _bootstrap((alarms, steps), lambda a, n: a.sum(axis=-1) / np.maximum(n.sum(axis=-1), 1))
    return Interval(value=value, low=low, high=high)


def _share(hits: int, trials: int) -> Interval:
    found = stats.binomtest(hits, trials)
    limits = found.proportion_ci(_CONFIDENCE, method="exact")
    return Interval(value=hits / trials, low=float(limits.low), high=float(limits.high))


def _median(sample: Sequence[float] | NDArray[Any]) -> Interval:
    values = np.asarray(sample, dtype=np.float64)
    if not len(values):
        return Interval(value=np.nan, low=np.nan, high=np.nan)
    low, high = _bootstrap((values,), lambda one: np.median(one, axis=-1))
    return Interval(value=float(np.median(values)), low=low, high=high)


def _bootstrap(data: tuple[NDArray[Any], ...], statistic: Any) -> tuple[float, float]:  # noqa: ANN401 - reduces the last axis
    """Return the limits of the percentile bootstrap over the first and only axis; NaN for a single value."""
    if len(data[0]) < 2:  # noqa: PLR2004 - one value says nothing about its spread
        return float("nan"), float("nan")
    generator = np.random.default_rng(_SEED)
    picks = generator.integers(len(data[0]), size=(_RESAMPLES, len(data[0])))
    spread = statistic(*(one[picks] for one in data))
    tail = 50.0 * (1.0 - _CONFIDENCE)
    low, high = np.percentile(spread, [tail, 100.0 - tail])
    return float(low), float(high)
