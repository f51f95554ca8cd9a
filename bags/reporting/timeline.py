"""A run gathered for its report in one pass: a few small numbers a step, curves thinned, errors summed up."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bags.mcap.yaml_text import load
from bags.reporting.alarm_sources import MAIN, SOURCES, VERDICT
from bags.reporting.attacks import Attack, attacks_of
from bags.reporting.curves import Curves, stretch_length
from bags.reporting.fold import fold, stretches_of
from bags.reporting.options import DEFAULTS, ReportOptions
from bags.reporting.team import TeamGatherer, TeamSummary
from bags.runs.run_record import RunRecord
from dgu_sim.grid import Link
from monitor.detectors import Phase
from monitor.measures import ErrorSums, GridImpact, grid_impact, score, under_attack

MOST_PANELS = 24
_ALWAYS = frozenset({MAIN, VERDICT})  # sources that count though they never alarm


@dataclass(frozen=True, slots=True, kw_only=True)
class Timeline:
    """A run, gathered.

    Attributes:
        run: Its last window: topics, designs, events and documents of the run.
        steps: Complete steps.
        attacks: By start.
        truth: Whether the bag holds true states.
        phase: Shape (steps, links).
        alarms: Alarms of each source that the run has, shape (steps, links); tests that never alarmed are left out.
        left_out: Steps at which the receiver left each link out of its control, shape (links,).
        score: Largest |r_i| / threshold_i, shape (steps, links).
        impact: Distances from the goals of control, None without truth.
        clear_errors: Of the estimates of each link while it is not attacked; none without truth.
        attacked_errors: The same while it is.
        curves: What is drawn.
        team: What its monitors did as a team, None when they were none.
    """

    run: RunRecord
    steps: int
    attacks: tuple[Attack, ...]
    truth: bool
    phase: NDArray[np.uint8]
    alarms: Mapping[str, NDArray[np.bool_]]
    left_out: NDArray[np.int64]
    score: NDArray[np.float32]
    impact: GridImpact | None
    clear_errors: Mapping[Link, ErrorSums]
    attacked_errors: Mapping[Link, ErrorSums]
    curves: Curves
    team: TeamSummary | None = None

    @property
    def period_sec(self) -> float:
        """T_s [s]."""
        return self.run.sampling_period_sec

    @property
    def duration_sec(self) -> float:
        """Simulated time of its complete steps [s]."""
        return self.steps * self.period_sec

    @property
    def labelled(self) -> bool:
        """Whether the bag says what was attacked: one without truth and without attacks comes from outside."""
        return self.truth or bool(self.attacks)

    def attack_intervals(self, link: Link) -> tuple[tuple[int, int], ...]:
        """Steps [start, stop) of the attacks on a link."""
        return self.run.attack_intervals(link, self.steps)

    def telling(self) -> list[int]:
        """Positions of the links whose residuals are drawn: all, or the ones that there is something to say about."""
        count = len(self.run.links)
        peak = np.nan_to_num(np.fmax.reduce(self.score, axis=0, initial=0.0))
        attacked = np.array([bool(self.attack_intervals(link)) for link in self.run.links], dtype=np.bool_)
        order = np.lexsort((-peak, ~attacked))
        return sorted(order[:MOST_PANELS].tolist()) if count > MOST_PANELS else list(range(count))


def gather(
    windows: Iterable[RunRecord],
    steps: int,
    options: ReportOptions = DEFAULTS,
    drawn: tuple[int, int] | None = None,
) -> Timeline:
    """Go through a run once.

    Args:
        windows: Its consecutive windows; at least one.
        steps: Its complete steps, in all windows together.
        options: Choices behind the measures.
        drawn: Steps [start, stop) of the curves; None: all.
    """
    gatherer: _Gatherer | None = None
    for window in windows:
        gatherer = gatherer or _Gatherer(window, steps, options, drawn or (0, steps))
        gatherer.add(window)
        last = window
    assert gatherer is not None  # noqa: S101 - there is at least one window
    return gatherer.timeline(last)


class _Gatherer:
    """The arrays of a Timeline while its windows go by."""

    def __init__(self, first: RunRecord, steps: int, options: ReportOptions, drawn: tuple[int, int]) -> None:
        period_sec = first.sampling_period_sec
        self.steps, links, dgus, n = steps, len(first.links), len(first.topics.dgus), first.topics.widths.states
        self.block_steps = options.block_steps(steps, period_sec)
        self.settle_steps = round(options.aftermath_sec / period_sec)
        self.truth = False
        self.rated = _rated_currents(first)
        self.lags = np.array([_lag(first, link) for link in first.links], dtype=np.intp)
        self.attacked = np.array(
            [under_attack(steps, first.attack_intervals(link, steps)) for link in first.links], dtype=np.bool_
        ).reshape(links, steps)
        self.phase = np.zeros((steps, links), dtype=np.uint8)
        self.score = np.full((steps, links), np.nan, dtype=np.float32)
        self.judges = {name: source.start(first.links) for name, source in SOURCES.items()}
        self.alarms: dict[str, NDArray[np.bool_]] = {}
        self.left_out = np.zeros(links, dtype=np.int64)
        self.impact = np.full((steps, 3), np.nan)
        self.errors = np.zeros((stretches_of(steps, self.block_steps), 2, links, 3, n))  # clear/attacked; n, |e|, e^2
        self.before = np.full((int(self.lags.max(initial=0)), dgus, n), np.nan)  # states of the last window's end
        self.curves = Curves.empty(first, drawn[1] - drawn[0], drawn[0])
        self.team = TeamGatherer(first, steps, max(self.curves.score.length, stretch_length(steps, 1)))

    def add(self, window: RunRecord) -> None:
        """Take the next window."""
        self.team.add(window)
        if not window.steps:
            return
        rows = slice(window.first_step, window.end_step)
        ratio = score(window.residual, window.threshold)
        self.phase[rows], self.score[rows] = window.phase, np.minimum(ratio, 1e30)
        for name, judge in self.judges.items():
            alarm = judge(window)
            if alarm is not None and (name in _ALWAYS or alarm.any()):
                self.alarms.setdefault(name, np.zeros(self.phase.shape, dtype=np.bool_))[rows] = alarm
        if window.combined is not None:
            self.left_out += window.combined.verdict.dropped.sum(axis=0)
        if np.isfinite(window.x).any():
            self.truth = True
            found = grid_impact(window.x[:, :, 0], window.x[:, :, 1], window.reference - window.alpha, self.rated)
            self.impact[rows] = np.column_stack([found.mean_voltage, found.voltage, found.sharing])
            self._add_errors(window)
        self.curves.add(window, ratio, self.impact[rows])

    def _add_errors(self, window: RunRecord) -> None:
        """Compare each estimate with the state that it is of, lag steps ago."""
        states = np.concatenate([self.before, window.x])
        kept = len(self.before)
        steps = np.arange(window.steps)
        for position, link in enumerate(window.links):
            source = window.topics.dgus.index(link.source)
            error = window.estimate[:, position] - states[steps + kept - self.lags[position], source]
            counts = (window.phase[:, position] != Phase.SETTLING.value) & (
                steps + window.first_step >= self.settle_steps
            )
            attacked = self.attacked[position, window.first_step : window.end_step]
            for kind, among in enumerate((counts & ~attacked, counts & attacked)):
                known = among[:, None] & np.isfinite(error)
                magnitude = np.where(known, np.abs(error), 0.0)
                sums = np.stack([known.astype(np.float64), magnitude, magnitude * magnitude], axis=1)
                fold(self.errors[:, kind, position], sums, window.first_step, self.block_steps, np.add)
        self.before = states[len(states) - kept :]

    def timeline(self, last: RunRecord) -> Timeline:
        """What was gathered."""
        clear, attacked = (
            {
                link: ErrorSums(count=sums[:, 0], absolute=sums[:, 1], squared=sums[:, 2])
                for position, link in enumerate(last.links)
                for sums in (self.errors[:, kind, position],)
            }
            for kind in (0, 1)
        )
        mean_voltage, voltage, sharing = self.impact.T
        impact = GridImpact(mean_voltage=mean_voltage, voltage=voltage, sharing=sharing)
        return Timeline(
            run=last,
            steps=self.steps,
            attacks=attacks_of(last, self.steps),
            truth=self.truth,
            phase=self.phase,
            alarms={name: self.alarms[name] for name in SOURCES if name in self.alarms},
            left_out=self.left_out,
            score=self.score,
            impact=impact if self.truth else None,
            clear_errors=clear if self.truth else {},
            attacked_errors=attacked if self.truth else {},
            curves=self.curves,
            team=self.team.summary(),
        )


def _lag(run: RunRecord, link: Link) -> int:
    return run.designs[link].lag if link in run.designs else 0


def _rated_currents(run: RunRecord) -> NDArray[np.float64]:
    """I^r of each DGU [A]; 1 where the bag's scenario does not say."""
    document = load(run.scenario_text) if run.scenario_text else None
    units = document.get("dgus", []) if isinstance(document, dict) else []
    rated = {one.get("id"): one.get("rated_current_a", 1.0) for one in units if isinstance(one, dict)}
    return np.array([float(rated.get(dgu, 1.0)) for dgu in run.topics.dgus])
