"""What report and pictures need of a run, gathered window by window: its size does not depend on the run's length."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from bags.reporting.team_outline import TeamOutline, TeamSketch
from bags.runs.run_record import RunRecord
from dgu_sim.grid import Link
from monitor.detectors import Phase
from monitor.metrics import LinkMetrics, LinkTally, add_steps, init_tally, metrics_of

MOST_POINTS = 2000  # more than a picture has pixels in a panel


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Outline:
    """A run without its single steps.

    Attributes:
        run: The last window: topics, designs, events and documents of the run.
        steps: Complete steps of the run.
        metrics: Of each link, in the order of the links.
        time_sec: Simulated time of each thinned row, shape (rows,) [s].
        x: True states at these rows, shape (rows, dgus, 3) [V, A, V s].
        alpha: Secondary corrections, shape (rows, dgus) [V].
        threshold: Thresholds, shape (rows, links, 3) [V, A, V s].
        stretch_sec: Start of each of many short stretches, shape (stretches,) [s].
        peaks: Largest |r| in each stretch, shape (stretches, links, 3): thinning must not hide a spike.
        team: What its monitors did as a team, None when they were none.
    """

    run: RunRecord
    steps: int
    metrics: tuple[LinkMetrics, ...]
    time_sec: NDArray[np.float64]
    x: NDArray[np.float64]
    alpha: NDArray[np.float64]
    threshold: NDArray[np.float64]
    stretch_sec: NDArray[np.float64]
    peaks: NDArray[np.float64]
    team: TeamOutline | None = None

    @property
    def duration_sec(self) -> float:
        """Length of the run [s]."""
        return self.steps * self.run.sampling_period_sec

    def attack_intervals(self, link: Link) -> tuple[tuple[int, int], ...]:
        """Steps [start, stop) of the attacks on a link."""
        return self.run.attack_intervals(link, self.steps)


def outline(windows: Iterable[RunRecord], steps: int) -> Outline:
    """Go through a run once.

    Args:
        windows: Its consecutive windows; at least one.
        steps: Its complete steps, in all windows together.
    """
    sketch = _Sketch(steps=steps)
    team = TeamSketch(stretches=-(-steps // stretch_length(steps)), length=stretch_length(steps))
    tallies: list[LinkTally] = []
    for window in windows:
        tallies = tallies or [init_tally(window.threshold.shape[2]) for _ in window.links]
        tallies = [_tallied(tally, window, position, steps) for position, tally in enumerate(tallies)]
        sketch.add(window)
        team.add(window)
        last = window
    period_sec = last.sampling_period_sec
    metrics = tuple(
        metrics_of(tally, last.attack_intervals(link, steps), period_sec)
        for tally, link in zip(tallies, last.links, strict=True)
    )
    return Outline(run=last, steps=steps, metrics=metrics, team=team.outline(), **sketch.arrays(period_sec))


def outline_of(record: RunRecord) -> Outline:
    """The outline of a run that is in memory."""
    return outline([record], record.steps)


def _tallied(tally: LinkTally, window: RunRecord, position: int, steps: int) -> LinkTally:
    return add_steps(
        tally,
        window.alarm[:, position],
        window.residual[:, position],
        window.attack_intervals(window.links[position], steps),
        threshold=window.threshold[:, position],
        armed=window.phase[:, position] > Phase.SETTLING.value,
    )


@final
@dataclass(slots=True, kw_only=True)
class _Sketch:
    """The curves of a run, thinned while its windows go by."""

    steps: int
    kept: list[tuple[NDArray[np.float64], ...]] = field(default_factory=list)
    peaks: NDArray[np.float64] | None = None

    def add(self, window: RunRecord) -> None:
        """Take the next window."""
        rows = thinned(self.steps)
        first, end = np.searchsorted(rows, (window.first_step, window.end_step))
        local = rows[first:end] - window.first_step
        self.kept.append((window.x[local], window.alpha[local], window.threshold[local]))
        length = stretch_length(self.steps)
        if self.peaks is None:
            self.peaks = np.full((-(-self.steps // length), *window.residual.shape[1:]), np.nan)
        if window.steps:
            stretches = np.arange(window.first_step, window.end_step) // length
            starts = np.flatnonzero(np.diff(stretches, prepend=-1))
            found = np.fmax.reduceat(np.abs(window.residual[: window.steps]), starts, axis=0)
            into = stretches[starts]
            self.peaks[into] = np.fmax(self.peaks[into], found)

    def arrays(self, period_sec: float) -> dict[str, Any]:
        """The curves by the names they have in an Outline."""
        x, alpha, threshold = (np.concatenate(parts) for parts in zip(*self.kept, strict=True))
        peaks = np.empty(0) if self.peaks is None else self.peaks
        return {
            "time_sec": thinned(self.steps) * period_sec,
            "x": x,
            "alpha": alpha,
            "threshold": threshold,
            "stretch_sec": np.arange(len(peaks)) * (stretch_length(self.steps) * period_sec),
            "peaks": peaks,
        }


def thinned(steps: int) -> NDArray[np.intp]:
    """At most so many rows as there are pixels, first and last included."""
    return np.unique(np.linspace(0, max(steps - 1, 0), min(steps, MOST_POINTS)).round().astype(np.intp))


def stretch_length(steps: int) -> int:
    """Steps of each stretch of which only the peak is drawn."""
    return max(-(-steps // MOST_POINTS), 1)
