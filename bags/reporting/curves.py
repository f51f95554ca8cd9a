"""What a report draws over time, thinned while the windows of a run go by."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bags.reporting.fold import Envelope
from bags.runs.run_record import RunRecord
from monitor.measures import score

FLOOR = 1e-16  # rounding of double precision: smaller residuals are drawn here
_MOST_NUMBERS = 400_000  # of all curves together: about 3 MB of the page
_MOST_POINTS, _FEWEST_POINTS = 1000, 100  # stretches of a curve


@dataclass(frozen=True, slots=True, kw_only=True)
class Curves:
    """What is drawn over time.

    Attributes:
        x: True states, (dgus, n) [V, A, V s].
        alpha: Secondary corrections, (dgus,) [V].
        residual: |r|, (links, p) [V, A, V s].
        threshold: (links, p) [V, A, V s].
        score: Largest |r_i| / threshold_i, (links,).
        impact: <V> - <V_ref> [V], max |dV_i| [V], sharing spread, (3,).
        own: Largest |r_i| / threshold_i of the own state of each monitor, (monitors,); NaN without such tests.
        inputs: Reconstructed inputs, least and largest plausible ones, (links, 3, applied) [A, V]; likewise.
    """

    x: Envelope
    alpha: Envelope
    residual: Envelope
    threshold: Envelope
    score: Envelope
    impact: Envelope
    own: Envelope
    inputs: Envelope

    @classmethod
    def empty(cls, run: RunRecord, steps: int, first_step: int = 0) -> "Curves":
        """Before the first window of a run: curves over so many steps from `first_step` on."""
        dgus, links, monitors = len(run.topics.dgus), len(run.links), len(run.topics.monitors)
        n, p, applied = run.topics.widths.states, run.topics.widths.outputs, run.topics.widths.applied
        length = stretch_length(steps, (n + 1) * dgus + (2 * p + 1) * links)

        def curve(*shape: int) -> Envelope:
            return Envelope.empty(steps, length, *shape, first_step=first_step)

        return cls(
            x=curve(dgus, n),
            alpha=curve(dgus),
            residual=curve(links, p),
            threshold=curve(links, p),
            score=curve(links),
            impact=curve(3),
            own=curve(monitors),
            inputs=curve(links, 3, applied),
        )

    def add(self, window: RunRecord, ratio: NDArray[np.float64], impact: NDArray[np.float64]) -> None:
        """Take the next window.

        Args:
            window: The window.
            ratio: Scores of its residuals, shape (steps, links).
            impact: Shape (steps, 3).
        """
        first = window.first_step
        self.x.add(window.x, first)
        self.alpha.add(window.alpha, first)
        self.residual.add(np.abs(window.residual), first)
        self.threshold.add(window.threshold, first)
        self.score.add(ratio, first)
        self.impact.add(impact, first)
        local = None if window.combined is None else window.combined.local
        if local is not None:
            self.own.add(score(local.residual, local.threshold), first)
        inputs = None if window.combined is None else window.combined.inputs
        if inputs is not None:
            limits = [np.where(np.isfinite(one), one, np.nan) for one in (inputs.lower, inputs.upper)]
            self.inputs.add(np.stack([inputs.input, *limits], axis=2), first)


def stretch_length(steps: int, curves: int) -> int:
    """Steps of each stretch of which only the extremes are drawn."""
    points = min(max(_MOST_NUMBERS // max(2 * curves, 1), _FEWEST_POINTS), _MOST_POINTS)
    return 1 if steps <= 2 * points else -(-steps // points)


def log_range(residual: NDArray[np.float64], threshold: NDArray[np.float64]) -> tuple[float, float]:
    """Limits of a logarithmic axis for residuals and their thresholds."""
    numbers = np.concatenate([residual.ravel(), threshold.ravel()])
    numbers = numbers[np.isfinite(numbers)]
    positive = numbers[numbers > FLOOR]
    bottom = float(np.quantile(positive, 0.02)) if positive.size else FLOOR
    return max(bottom / 3.0, FLOOR / 3.0), max(float(numbers.max(initial=1e-3)), FLOOR) * 8.0
