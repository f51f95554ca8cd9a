"""Input reconstruction on windows that its design has not seen: inputs against those recorded."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from monitor.proof import Trial, noise, prove, rounding, stretches
from monitor.sight import noise_covariance
from monitor.trials import run_linear

if TYPE_CHECKING:
    from monitor.history import History
    from monitor.input_reconstruction.realisation import Gains
    from monitor.linear_observer import LinearObserver
    from monitor.proof import Proof, Split
    from monitor.scaling import Scaling


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """What is to be proved.

    Attributes:
        exact: the record carries rounding only.
        unknowns: directions that the windows span.
        spare_columns: windows beyond those.
        tolerance: relative rounding of the samples.
    """

    exact: bool
    unknowns: int
    spare_columns: int
    tolerance: float


def prove_inputs(observer: LinearObserver, gains: Gains, split: Split, units: Scaling, claim: Claim) -> Proof:
    """Start in every unseen stretch from the recorded inputs before it, then run freely to its end.

    Args:
        observer: the finished estimator, in shares of the spread.
        gains: its sizes.
        split: the record in the user's units.
        units: the spread.
        claim: what is to be proved.
    """
    unseen = _tried(observer, gains, units.scaled(split.unseen))
    gain = float(np.sqrt(np.max(np.diag(noise_covariance(observer, np.eye(observer.outputs))), initial=0.0)))
    allowed = rounding(claim.tolerance, gain, unseen)
    if not claim.exact:
        # recorded inputs are not those that noisy outputs speak for: a start moves the residual, so starts are alike
        shortest = gains.past + gains.future + 1
        again = max((len(one.y) for one in stretches(split.unseen)), default=shortest)
        allowed = noise(
            _tried(observer, gains, units.scaled(_cut(split.seen, max(again, shortest)))), claim.unknowns, allowed
        )
    return prove(unseen, allowed, (units.u, units.y), spare_columns=claim.spare_columns, estimate="inputs")


def _cut(history: History, length: int) -> History:
    """Every experiment in parts of this length, the last one shorter."""
    parts = [
        replace(one, **{name: getattr(one, name)[at : at + length] for name in ("u", "y", "x", "d", "w")})
        for one in history.experiments
        for at in range(0, len(one.y), length)
    ]
    return replace(history, experiments=tuple(parts))


def _tried(observer: LinearObserver, gains: Gains, history: History) -> list[Trial]:
    past, first = gains.past, gains.past + gains.future - 1
    trials = []
    for one in stretches(history):
        if len(one.y) <= first:
            continue
        start = np.concatenate([one.u[:past].ravel(), one.y[:first].ravel()])
        estimate, residual = run_linear(observer, one.y[first:], start)
        error = estimate - one.u[past : past + len(estimate)]
        size = max(float(np.max(np.abs(table), initial=0.0)) for table in (one.u, one.y))
        trials.append(Trial(error=error, residual=residual, size=size))
    return trials
