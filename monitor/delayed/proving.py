"""A delayed observer on samples that its design has not seen.

A gain that cancels the unknown inputs must be exact there. One that bounds what they do must stay within its bounds for
the unknown inputs that the unseen samples show, and these must obey the model at all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from monitor.constant_input import ConstantInput, linear_part
from monitor.delayed.bounds import respond
from monitor.delayed.model import window_of
from monitor.proof import Allowance, Trial, noise, of_their_size, prove, rounding, stretches
from monitor.sight import noise_covariance
from monitor.trials import run_linear

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from monitor.certificate import Guarantee
    from monitor.delayed.report import DelayedDesign
    from monitor.history import Experiment, History
    from monitor.linear_observer import LinearObserver
    from monitor.proof import Proof, Split
    from monitor.scaling import Scaling


_WORTHLESS = 1.0  # spreads: an estimate with a larger error is no better than the mean of the history


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """What the design was made from.

    Attributes:
        split: the history in the user's units; each unseen stretch begins with the samples that fill the memory.
        spread: of its signals.
        exact: it carries rounding only.
        unknowns: directions that its columns span.
        spare_columns: columns beyond those.
        tolerance: relative rounding of the samples.
        hardly: see `Proof`.
    """

    split: Split
    spread: Scaling
    exact: bool
    unknowns: int
    spare_columns: int
    tolerance: float
    hardly: float = 0.0

    def allowed(self, seen: Sequence[Trial], unseen: Sequence[Trial], gain: float) -> Allowance:
        """What rounding or the noise of the history allows."""
        exact = rounding(self.tolerance, gain, unseen)
        return exact if self.exact else noise(seen, self.unknowns, exact)


def prove_delayed(made: DelayedDesign, claim: Claim) -> Proof:
    """Start from the recorded state in every unseen stretch, then run freely to its end.

    Args:
        made: accepted, in the user's units.
        claim: what it was made from.
    """
    spread, split = claim.spread, claim.split
    unseen = _tried(made, split.unseen, spread)
    gain = _gain(made, spread)
    scales = (spread.x, spread.y)
    if made.guarantee is None or made.guarantee.exact:
        seen = [] if claim.exact else _tried(made, split.seen, spread)
        allowed = claim.allowed(seen, unseen, gain)
        allowed = replace(allowed, error=np.minimum(allowed.error, _WORTHLESS))
        unseen = of_their_size(unseen) if claim.exact else unseen
        return prove(
            unseen, allowed, scales, spare_columns=claim.spare_columns, hardly=claim.hardly * (1.0 + gain * claim.exact)
        )
    predicted, new = (_predicted(made, one, spread) for one in (split.seen, split.unseen))
    believed = claim.allowed(predicted, new, 1.0)
    model = prove(new, believed, (spread.x, np.zeros(0)), spare_columns=claim.spare_columns, estimate="prediction")
    if not model.holds:
        return model
    slack = float(np.max(believed.error, initial=0.0)) * (1.0 + gain)
    error, residual = _bounds(made, split.unseen, spread.x)
    basis = "the guaranteed bounds for unknown inputs of this size"
    bounded = Allowance(error=error / spread.x + slack, residual=residual / spread.y + slack, basis=basis)
    return prove(unseen, bounded, scales, spare_columns=claim.spare_columns)


def prove_inputs(
    observer: LinearObserver | ConstantInput,
    guarantee: Guarantee,
    claim: Claim,
    around: tuple[NDArray[np.float64], NDArray[np.float64]] | None,
) -> Proof:
    """Hold reconstructed inputs [d; phi] against the d that was recorded; phi is 0 there.

    Args:
        observer: in the user's units.
        guarantee: of the design.
        claim: what it was made from.
        around: mean of d and how much of [d; phi] counts as |w| = 1, for a bounded design; None for an exact one.
    """
    spread, inner = claim.spread, linear_part(observer)
    extra = inner.states - len(spread.d)
    scale = np.concatenate([spread.d, np.ones(extra)])
    seen, unseen = (
        _tried_inputs(observer, one, scale, guarantee.delay) for one in (claim.split.seen, claim.split.unseen)
    )
    covariance = noise_covariance(inner, np.diag(spread.y**2))[: len(scale), : len(scale)]
    gain = float(np.sqrt(np.max(np.diag(covariance) / scale**2, initial=0.0)))
    if around is None:
        allowed = claim.allowed(seen, unseen, gain)
        allowed = replace(allowed, error=np.minimum(allowed.error, _WORTHLESS))
    else:
        mean, reach = around
        deviations = [(one.d - mean) / reach[: len(mean)] for one in stretches(claim.split.unseen)]
        largest = max((float(np.max(np.linalg.norm(one, axis=1), initial=0.0)) for one in deviations), default=0.0)
        slack = float(np.max(rounding(claim.tolerance, gain, unseen).error))
        allowed = Allowance(
            error=guarantee.input_bound * largest * reach / scale + slack,
            residual=0.0,
            basis="the guaranteed bound for inputs of this size",
        )
    return prove(
        unseen,
        allowed,
        (scale, np.zeros(0)),
        spare_columns=claim.spare_columns,
        estimate="inputs",
        hardly=claim.hardly,
    )


def _tried_inputs(
    observer: LinearObserver | ConstantInput, history: History, scale: NDArray[np.float64], delay: int
) -> list[Trial]:
    """Errors of the reconstructed inputs from the first that the recorded state and the samples so far allow."""
    trials = []
    for one in stretches(history):
        if len(one.y) <= delay + 1 or not np.isfinite(one.d).all():
            continue
        inner, v = samples_of(observer, one)
        start = np.concatenate([one.x[0], v[:delay].ravel()])
        estimate, _ = run_linear(inner, v[delay:], start)
        truth = np.hstack([one.d[: len(estimate)], np.zeros((len(estimate), inner.states - one.d.shape[1]))])
        size = float(np.max(np.abs(one.d) / scale[: one.d.shape[1]], initial=1.0))
        trials.append(Trial(error=(estimate - truth) / scale, residual=np.zeros((len(estimate), 0)), size=size))
    return trials


def samples_of(observer: LinearObserver | ConstantInput, one: Experiment) -> tuple[LinearObserver, NDArray[np.float64]]:
    """The linear observer inside and all that it receives, (T, m + p), the constant included."""
    constant = np.ones((len(one.y), int(isinstance(observer, ConstantInput))))
    return linear_part(observer), np.hstack([constant, one.u, one.y])


def _tried(made: DelayedDesign, history: History, spread: Scaling) -> list[Trial]:
    """Error and residual from sample `delay` on; the state before it is the recorded one and the samples so far."""
    delay, trials = 0 if made.guarantee is None else made.guarantee.delay, []
    assert made.observer is not None  # noqa: S101 - an accepted design has one
    for one in stretches(history):
        if len(one.y) <= delay + 1:
            continue
        observer, v = samples_of(made.observer, one)
        start = np.concatenate([one.x[0], v[:delay].ravel()])
        estimate, residual = run_linear(observer, v[delay:], start)
        first = min(delay, 1)
        error = estimate - one.x[first : first + len(estimate)]
        size = max(float(np.max(np.abs(one.x / spread.x))), float(np.max(np.abs(one.y / spread.y))))
        trials.append(Trial(error=error / spread.x, residual=residual / spread.y, size=size))
    return trials


def _gain(made: DelayedDesign, spread: Scaling) -> float:
    """How much larger than the received signals the answer can be, in shares of the spread."""
    assert made.observer is not None  # noqa: S101 - an accepted design has one
    covariance = noise_covariance(linear_part(made.observer), np.diag(spread.y**2))
    return float(np.sqrt(np.max(np.diag(covariance) / np.concatenate([spread.x, spread.y]) ** 2, initial=0.0)))


def _unknown(
    made: DelayedDesign, history: History, x: NDArray[np.float64]
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Of each stretch w (q, T - 1) and what it leaves of the states (n, T - 1): the least in shares of x (n,)."""
    model, found = made.model, []
    assert model is not None  # noqa: S101 - an accepted design has one
    for one in stretches(history):
        known = np.hstack([np.ones((len(one.y), 1)), one.u])[:, -model.B_u.shape[1] or len(one.y) :]
        rest = (one.x[1:] - one.x[:-1] @ model.A.T - known[:-1] @ model.B_u.T).T
        w = np.linalg.pinv(model.B / x[:, None]) @ (rest / x[:, None])
        found.append((w, rest - model.B @ w))
    return found


def _predicted(made: DelayedDesign, history: History, spread: Scaling) -> list[Trial]:
    """What no unknown input explains of the next state."""
    sizes = [float(np.max(np.abs(one.x / spread.x), initial=0.0)) for one in stretches(history)]
    return [
        Trial(error=rest.T / spread.x, residual=np.zeros((rest.shape[1], 0)), size=size)
        for (_, rest), size in zip(_unknown(made, history, spread.x), sizes, strict=True)
    ]


def _bounds(
    made: DelayedDesign, history: History, x: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Largest error of each state and residual of each output that unknown inputs as large as these can cause."""
    assert made.model is not None  # noqa: S101 - an accepted design has one
    assert made.L is not None  # noqa: S101 - an accepted design has one
    assert made.guarantee is not None  # noqa: S101 - an accepted design has one
    largest = max(
        (float(np.max(np.linalg.norm(w, axis=0), initial=0.0)) for w, _ in _unknown(made, history, x)), default=0.0
    )
    window = window_of(made.model, made.guarantee.delay)
    response = respond(made.model, window, made.L, np.eye(len(made.model.A)))
    error = np.sum(np.linalg.norm(response.G, axis=2), axis=0) if response.ended else np.full(len(made.L), np.inf)
    moved = np.zeros(len(made.model.C)) if made.guarantee.residual_bound is None else made.guarantee.residual_bound
    return largest * error, largest * moved
